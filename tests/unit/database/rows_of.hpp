// SPDX-License-Identifier: Apache-2.0
// What a database says, to be compared: what counts is rows, not files.
#pragma once

#include <set>
#include <string>

#include <fmt/format.h>

#include "daemon/database/database.hpp"

namespace plumb::testing {

/// Everything that the tables hold, and the tables themselves.
/// @param without  Names of tables, or of columns, that do not count.
inline std::string RowsOf(Database& database, const std::set<std::string>& without = {}) {
  const auto text = [](const Statement& row) { return row.Text(0); };
  std::string rows;
  for (const std::string& sql : database.All("SELECT sql FROM sqlite_master ORDER BY name", text))
    rows += sql + "\n";
  for (const std::string& table :
       database.All("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name", text)) {
    if (without.contains(table)) continue;
    std::string columns;
    for (const std::string& column :
         database.All(fmt::format("SELECT name FROM pragma_table_info('{}')", table), text)) {
      if (!without.contains(column))
        columns += fmt::format("{}quote(\"{}\")", columns.empty() ? "" : " || ',' || ", column);
    }
    for (const std::string& row :
         database.All(fmt::format("SELECT {} FROM \"{}\" ORDER BY 1", columns, table), text))
      rows += fmt::format("{}: {}\n", table, row);
  }
  return rows;
}

}  // namespace plumb::testing
