// SPDX-License-Identifier: Apache-2.0
// Tables as CSV (RFC 4180), with the types of their columns beside them as CSV on the Web (W3C).
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

struct TableColumn {
  std::string name;      ///< With the unit: "vertical_mm".
  std::string datatype;  ///< Of XML Schema: "string", "double", "integer".
  std::string says;      ///< In English, for dc:description.
};

using TableRow = std::vector<std::string>;  ///< A cell a column; an empty one: not known.

/// The table, with a line of column names.
[[nodiscard]] std::string TableText(const std::vector<TableColumn>& columns,
                                    const std::vector<TableRow>& rows);
/// What NAME-metadata.json says of the table.
[[nodiscard]] std::string TableMetadata(const std::vector<TableColumn>& columns,
                                        std::string_view name);

/// Writes both, each completely or not at all. @throws IoError
void WriteTable(const std::vector<TableColumn>& columns, const std::vector<TableRow>& rows,
                const std::filesystem::path& file);

}  // namespace plumb
