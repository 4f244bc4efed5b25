// SPDX-License-Identifier: Apache-2.0
// Versions such as "5.16.0.1", compared number by number.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace plumb {

using VersionNumbers = std::array<int, 4>;

namespace version_numbers {
inline constexpr int kLargest = 99999;
}  // namespace version_numbers

/// Nothing unless the text is of one to four numbers with dots between them.
[[nodiscard]] inline std::optional<VersionNumbers> StrictVersionNumbers(std::string_view text) {
  VersionNumbers numbers{};
  std::size_t part = 0;
  bool has_digit = false;
  for (const char c : text) {
    if (c == '.') {
      if (!has_digit || ++part == numbers.size()) return std::nullopt;
      has_digit = false;
      continue;
    }
    if (c < '0' || c > '9') return std::nullopt;
    int& number = numbers[part];
    number = 10 * number + (c - '0');
    if (number > version_numbers::kLargest) return std::nullopt;
    has_digit = true;
  }
  return has_digit ? std::optional(numbers) : std::nullopt;
}

/// Up to the first character that does not belong to a version; what is missing counts as 0.
[[nodiscard]] inline VersionNumbers VersionNumbersIn(std::string_view text) {
  text = text.substr(0, text.find_first_not_of("0123456789."));
  while (!text.empty()) {
    if (const auto numbers = StrictVersionNumbers(text)) return *numbers;
    text.remove_suffix(1);
  }
  return {};
}

}  // namespace plumb
