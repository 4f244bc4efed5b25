// SPDX-License-Identifier: Apache-2.0
#include "web/exchange/csv.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace plumb::web {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

char SeparatorOf(const Catalogue& language) { return language.decimal == ',' ? ';' : ','; }

}  // namespace

CsvTable::CsvTable(const Catalogue& language)
    : separator_(SeparatorOf(language)), decimal_(language.decimal), text_(kByteOrderMark) {}

CsvTable& CsvTable::Plain(std::string_view text) {
  if (!std::exchange(begins_row_, false)) text_ += separator_;
  text_ += text;
  return *this;
}

CsvTable& CsvTable::Text(std::string text) {
  if (!text.empty() && std::string_view("=+-@\t\r").find(text[0]) != std::string_view::npos)
    text = "'" + text;
  if (text.find_first_of(",;\"\n\r") == std::string::npos) return Plain(text);
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return Plain(quoted + "\"");
}

CsvTable& CsvTable::Number(const std::optional<double>& value) {
  if (!value) return Empty();
  std::string number = fmt::format("{:.4f}", *value);
  std::ranges::replace(number, '.', decimal_);
  return Plain(number);
}

void CsvTable::EndRow() {
  text_ += "\r\n";
  begins_row_ = true;
}

std::string CsvFor(const Catalogue& language, std::string_view plain) {
  std::string text(kByteOrderMark);
  text += plain;
  std::ranges::replace(text, ',', SeparatorOf(language));
  std::ranges::replace(text, '.', language.decimal);
  return text;
}

}  // namespace plumb::web
