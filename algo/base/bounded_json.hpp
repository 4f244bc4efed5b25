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
/// @throws DataError saying what is wrong: not JSON, or nested too deep.
template <class Json = nlohmann::json>
[[nodiscard]] Json ParseBoundedJson(std::string_view text);

/// As ParseBoundedJson(), but a discarded value in place of the error.
template <class Json = nlohmann::json>
[[nodiscard]] Json ParseBoundedJsonOrNothing(std::string_view text);

extern template nlohmann::json ParseBoundedJson(std::string_view);
extern template nlohmann::json ParseBoundedJsonOrNothing(std::string_view);
extern template nlohmann::ordered_json ParseBoundedJson(std::string_view);
extern template nlohmann::ordered_json ParseBoundedJsonOrNothing(std::string_view);

}  // namespace plumb
