// SPDX-License-Identifier: Apache-2.0
// The form in which codes are compared, whether they were typed or scanned.
#pragma once

#include <string>
#include <string_view>

namespace plumb {

/// The code in capitals, without spaces and hyphens. Codes with the same plain form are the same.
[[nodiscard]] inline std::string PlainCode(std::string_view code) {
  std::string plain;
  for (const char c : code)
    if (c != '-' && c != ' ') plain += c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  return plain;
}

}  // namespace plumb
