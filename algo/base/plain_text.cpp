// SPDX-License-Identifier: Apache-2.0
#include "algo/base/plain_text.hpp"

#include <algorithm>
#include <array>
#include <cstdint>

#include "algo/base/utf8.hpp"

namespace plumb {
namespace {

struct CodeRange {
  std::uint32_t first, last;
};

/// Categories Cf, Zl and Zp of Unicode 15, in their order, and the whole block of tags.
constexpr std::array<CodeRange, 21> kFormatCharacters = {
    {{0xAD, 0xAD},       {0x600, 0x605},     {0x61C, 0x61C},     {0x6DD, 0x6DD},
     {0x70F, 0x70F},     {0x890, 0x891},     {0x8E2, 0x8E2},     {0x180E, 0x180E},
     {0x200B, 0x200F},   {0x2028, 0x202E},   {0x2060, 0x2064},   {0x2066, 0x206F},
     {0xFEFF, 0xFEFF},   {0xFFF9, 0xFFFB},   {0x110BD, 0x110BD}, {0x110CD, 0x110CD},
     {0x13430, 0x1343F}, {0x1BCA0, 0x1BCA3}, {0x1D173, 0x1D17A}, {0xE0001, 0xE0001},
     {0xE0020, 0xE007F}}};

bool IsPlainCode(std::uint32_t code) {
  if (code < 0x20 || (code >= 0x7F && code < 0xA0)) return false;
  const auto* const after =
      std::ranges::upper_bound(kFormatCharacters, code, {}, &CodeRange::first);
  return after == kFormatCharacters.begin() || code > std::prev(after)->last;
}

}  // namespace

bool IsPlainText(std::string_view text, bool allow_lines) {
  while (!text.empty()) {
    std::uint32_t code = 0;
    const std::size_t length = Utf8Length(text, code);
    if (length == 0) return false;
    const bool is_line = code == '\n' || code == '\t';
    if (!IsPlainCode(code) && !(is_line && allow_lines)) return false;
    text.remove_prefix(length);
  }
  return true;
}

std::string AsPlainText(std::string_view text) {
  std::string plain;
  plain.reserve(text.size());
  while (!text.empty()) {
    std::uint32_t code = 0;
    const std::size_t length = std::max<std::size_t>(Utf8Length(text, code), 1);
    const std::string_view one = text.substr(0, length);
    plain += IsPlainText(one) ? one : std::string_view("\xEF\xBF\xBD");
    text.remove_prefix(length);
  }
  return plain;
}

}  // namespace plumb
