// SPDX-License-Identifier: Apache-2.0
// Bytes as text (RFC 4648).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace plumb {

inline constexpr std::string_view kBase64Digits =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

[[nodiscard]] inline std::string ToBase64(std::string_view bytes) {
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  std::uint32_t bits = 0;
  int num_bits = 0;
  for (const char byte : bytes) {
    bits = bits << 8U | static_cast<unsigned char>(byte);
    for (num_bits += 8; num_bits >= 6;) text += kBase64Digits[bits >> (num_bits -= 6) & 63U];
  }
  if (num_bits > 0) text += kBase64Digits[bits << (6 - num_bits) & 63U];
  text.append((4 - text.size() % 4) % 4, '=');
  return text;
}

/// With '-' and '_' and without padding, as it may stand in a cookie.
[[nodiscard]] inline std::string ToBase64Url(std::string_view bytes) {
  std::string text = ToBase64(bytes);
  std::erase(text, '=');
  std::ranges::replace(text, '+', '-');
  std::ranges::replace(text, '/', '_');
  return text;
}

/// The reverse of ToBase64(); nothing if that makes no such text.
[[nodiscard]] inline std::optional<std::string> FromBase64(std::string_view text) {
  if (text.size() % 4 != 0) return std::nullopt;
  for (int i = 0; i < 2 && text.ends_with('='); ++i) text.remove_suffix(1);
  std::string bytes;
  bytes.reserve(text.size() / 4 * 3 + 2);
  std::uint32_t bits = 0;
  int num_bits = 0;
  for (const char c : text) {
    const std::size_t digit = kBase64Digits.find(c);
    if (digit == std::string_view::npos) return std::nullopt;
    bits = bits << 6U | static_cast<std::uint32_t>(digit);
    num_bits += 6;
    if (num_bits >= 8) bytes += static_cast<char>(bits >> (num_bits -= 8) & 255U);
  }
  if ((bits & ((1U << static_cast<unsigned>(num_bits)) - 1)) != 0) return std::nullopt;
  return bytes;
}

}  // namespace plumb
