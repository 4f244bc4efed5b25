// SPDX-License-Identifier: Apache-2.0
// Small letters, in any locale.
#pragma once

#include <string>
#include <string_view>

namespace plumb {

/// Of A to Z; other bytes, such as those of UTF-8, stay as they are.
[[nodiscard]] constexpr char AsciiLower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

[[nodiscard]] inline std::string AsciiLower(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) c = AsciiLower(c);
  return lower;
}

}  // namespace plumb
