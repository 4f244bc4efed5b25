// Spanish translations of the appliance's words, for pages and reports made by the server.
#pragma once

#include <optional>
#include <string>

namespace plumb::web {

/// Translates a direction, part of the body or reason; nothing if there is no translation.
/// Thread-safe.
[[nodiscard]] std::optional<std::string> InSpanish(const std::string& text);

}  // namespace plumb::web
