// SPDX-License-Identifier: Apache-2.0
// Parses JSON from untrusted sources.
#pragma once

#include <string_view>

#include <nlohmann/json.hpp>

namespace plumb {

/// Plumb's own files are nested less than half as deep. JSON that is nested ten thousand levels
/// deep overflows the stack when it is copied or printed.
inline constexpr int kMaxJsonDepth = 32;

/// Parses one value with nothing after it.
/// @tparam Json nlohmann::json, or nlohmann::ordered_json, which keeps the order of the keys.
/// @param max_depth  Levels of objects and arrays; 1 is an object of plain values.
/// @throws DataError stating what is wrong: not JSON, or nested too deep.
template <class Json = nlohmann::json>
[[nodiscard]] Json ParseBoundedJson(std::string_view text, int max_depth = kMaxJsonDepth);

/// As ParseBoundedJson(), but returns a discarded value instead of throwing.
template <class Json = nlohmann::json>
[[nodiscard]] Json ParseBoundedJsonOrNothing(std::string_view text, int max_depth = kMaxJsonDepth);

extern template nlohmann::json ParseBoundedJson(std::string_view, int);
extern template nlohmann::json ParseBoundedJsonOrNothing(std::string_view, int);
extern template nlohmann::ordered_json ParseBoundedJson(std::string_view, int);
extern template nlohmann::ordered_json ParseBoundedJsonOrNothing(std::string_view, int);

}  // namespace plumb
