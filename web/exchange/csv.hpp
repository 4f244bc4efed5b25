// SPDX-License-Identifier: Apache-2.0
// Cells of a CSV file that spreadsheets open.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include <fmt/format.h>

namespace plumb::web {

/// A cell that no spreadsheet interprets as a formula, quoted if necessary.
[[nodiscard]] inline std::string CsvCell(std::string text) {
  if (!text.empty() && std::string_view("=+-@\t\r").find(text[0]) != std::string_view::npos)
    text = "'" + text;
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

/// Numbers are not user input: a leading minus is not escaped.
[[nodiscard]] inline std::string CsvNumber(const std::optional<double>& value) {
  return value ? fmt::format("{:.4f}", *value) : std::string();
}

}  // namespace plumb::web
