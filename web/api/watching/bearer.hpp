// SPDX-License-Identifier: Apache-2.0
// Programs that ask without an account show a token (RFC 6750).
#pragma once

#include <string_view>

#include "web/http/message.hpp"

namespace plumb::web {

[[nodiscard]] bool IsBearerOf(const Request& request, std::string_view token);
/// The refusal to everybody else.
[[nodiscard]] Response NotTheBearer();

}  // namespace plumb::web
