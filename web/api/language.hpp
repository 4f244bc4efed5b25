// The language that a client requests.
#pragma once

#include "web/http/router.hpp"
#include "web/service/scan_service.hpp"

namespace plumb::web {

/// Language named by "?language=es"; English if none is named.
/// @throws DataError for an unknown language
[[nodiscard]] Language LanguageIn(const Request& request);

}  // namespace plumb::web
