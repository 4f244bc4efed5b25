// SPDX-License-Identifier: Apache-2.0
// Sources as a test reads them that counts something in them.
#pragma once

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <string>
#include <string_view>

namespace plumb {

/// The source without comments, preprocessor lines and what literals contain, with the same lines.
inline std::string CodeOnly(std::string_view source) {
  std::string code;
  bool is_line_begin = true;
  for (std::size_t i = 0; i < source.size(); ++i) {
    const std::string_view rest = source.substr(i);
    if (rest.starts_with("//") || (is_line_begin && rest[0] == '#')) {
      while (i < source.size() && source[i] != '\n') {
        if (source[i] == '\\') {
          if (source[i + 1] == '\n') code += '\n';
          ++i;
        }
        ++i;
      }
      code += '\n';
      is_line_begin = true;
      continue;
    }
    if (rest.starts_with("/*")) {
      const std::size_t end = source.find("*/", i) + 1;
      code.append(static_cast<std::size_t>(std::count(&source[i], &source[end], '\n')), '\n');
      i = end;
      continue;
    }
    if (rest.starts_with("R\"")) {
      const std::string end = ")" + std::string(rest.substr(2, rest.find('(') - 2)) + "\"";
      const std::size_t last = source.find(end, i) + end.size() - 1;
      code += "\"\"";
      code.append(static_cast<std::size_t>(std::count(&source[i], &source[last], '\n')), '\n');
      i = last;
      continue;
    }
    const bool is_separator = i > 0 && std::isalnum(static_cast<unsigned char>(source[i - 1])) != 0;
    if (rest[0] == '"' || (rest[0] == '\'' && !is_separator)) {
      const char quote = rest[0];
      for (++i; i < source.size() && source[i] != quote; ++i)
        if (source[i] == '\\') ++i;
      code += "\"\"";
      continue;
    }
    if (std::isspace(static_cast<unsigned char>(rest[0])) == 0) is_line_begin = false;
    if (rest[0] == '\n') is_line_begin = true;
    code += rest[0];
  }
  return code;
}

/// The last word of a text, which is cut off.
inline std::string LastWord(std::string_view& text) {
  const auto is_word = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '~';
  };
  while (!text.empty() && !is_word(text.back())) text.remove_suffix(1);
  std::size_t begin = text.size();
  while (begin > 0 && is_word(text[begin - 1])) --begin;
  std::string word(text.substr(begin));
  text = text.substr(0, begin);
  return word;
}

}  // namespace plumb
