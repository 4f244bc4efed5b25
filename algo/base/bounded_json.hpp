// JSON from outside.
#pragma once

#include <string_view>

#include <nlohmann/json.hpp>

namespace plumb {

/// No file of Plumb's is nested half as deep. What is nested some ten thousand deep overflows the
/// stack where it is copied or printed.
inline constexpr int kMaxJsonDepth = 32;

/// One value, with nothing after it.
/// @tparam Json nlohmann::json, or nlohmann::ordered_json, which keeps the keys' order.
/// @param max_depth levels of objects and arrays; 1 is an object of plain values.
/// @throws DataError saying what is wrong: not JSON, or nested too deep.
template <class Json = nlohmann::json>
[[nodiscard]] Json ParseBoundedJson(std::string_view text, int max_depth = kMaxJsonDepth);

/// As ParseBoundedJson(), but a discarded value in place of the error.
template <class Json = nlohmann::json>
[[nodiscard]] Json ParseBoundedJsonOrNothing(std::string_view text, int max_depth = kMaxJsonDepth);

extern template nlohmann::json ParseBoundedJson(std::string_view, int);
extern template nlohmann::json ParseBoundedJsonOrNothing(std::string_view, int);
extern template nlohmann::ordered_json ParseBoundedJson(std::string_view, int);
extern template nlohmann::ordered_json ParseBoundedJsonOrNothing(std::string_view, int);

}  // namespace plumb
