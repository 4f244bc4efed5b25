// SPDX-License-Identifier: Apache-2.0
// Codes as they are compared, whoever typed or scanned them.
#pragma once

#include <string>
#include <string_view>

namespace plumb {

/// Without spaces and hyphens and in capitals: codes that differ in nothing else are the same.
[[nodiscard]] inline std::string PlainCode(std::string_view code) {
  std::string plain;
  for (const char c : code)
    if (c != '-' && c != ' ') plain += c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  return plain;
}

}  // namespace plumb
