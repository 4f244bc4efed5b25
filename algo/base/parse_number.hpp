// SPDX-License-Identifier: Apache-2.0
// Numbers in texts from outside.
#pragma once

#include <charconv>
#include <optional>
#include <string_view>
#include <system_error>

namespace plumb {

/// The number that the whole text states, without spaces and without a plus; nothing if it states
/// none, or one that the type cannot hold.
template <typename Number>
[[nodiscard]] std::optional<Number> ParseNumber(std::string_view text) {
  Number number{};
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, number);
  if (error != std::errc() || stop != end) return std::nullopt;
  return number;
}

}  // namespace plumb
