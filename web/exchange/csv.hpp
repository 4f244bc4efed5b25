// SPDX-License-Identifier: Apache-2.0
// Tables for spreadsheets, which read by the language of their user: where the decimal sign is a
// comma, cells are separated by semicolons. Files of the command line, for programs, are not these.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "algo/base/message.hpp"

namespace plumb::web {

class CsvTable {
 public:
  /// Begins with the mark without which spreadsheets do not take a file as UTF-8.
  explicit CsvTable(const Catalogue& language);

  /// Of what people typed: no spreadsheet takes it as a formula.
  CsvTable& Text(std::string text);
  /// Of the program's own: names of columns, whole numbers, times.
  CsvTable& Plain(std::string_view text);
  /// Four decimals; empty without one. A leading minus is no formula.
  CsvTable& Number(const std::optional<double>& value);
  CsvTable& Empty() { return Plain({}); }
  void EndRow();

  [[nodiscard]] std::string Take() { return std::move(text_); }

 private:
  char separator_, decimal_;
  bool begins_row_ = true;
  std::string text_;
};

/// A table of commas, numbers with points and words without either, such as monitor.csv.
[[nodiscard]] std::string CsvFor(const Catalogue& language, std::string_view plain);

}  // namespace plumb::web
