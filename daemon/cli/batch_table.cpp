// SPDX-License-Identifier: Apache-2.0
#include "daemon/cli/batch_table.hpp"

#include <nlohmann/json.hpp>

#include "daemon/files/atomic_folder.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;

std::string TableCell(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string TableLine(const TableRow& cells) {
  std::string line;
  for (const std::string& cell : cells) line += TableCell(cell) + ",";
  line.back() = '\r';
  return line + "\n";
}

}  // namespace

std::string TableText(const std::vector<TableColumn>& columns, const std::vector<TableRow>& rows) {
  TableRow names;
  for (const TableColumn& column : columns) names.push_back(column.name);
  std::string text = TableLine(names);
  for (const TableRow& row : rows) text += TableLine(row);
  return text;
}

std::string TableMetadata(const std::vector<TableColumn>& columns, std::string_view name) {
  Json json = {{"@context", {"http://www.w3.org/ns/csvw", {{"@language", "en"}}}},
               {"url", name},
               {"dialect", {{"encoding", "utf-8"}, {"header", true}, {"lineTerminators", "\r\n"}}},
               {"tableSchema", {{"columns", Json::array()}}}};
  for (const TableColumn& column : columns) {
    json["tableSchema"]["columns"].push_back({{"name", column.name},
                                              {"titles", column.name},
                                              {"datatype", column.datatype},
                                              {"dc:description", column.says}});
  }
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

void WriteTable(const std::vector<TableColumn>& columns, const std::vector<TableRow>& rows,
                const std::filesystem::path& file) {
  const auto write = [](const std::filesystem::path& path, const std::string& text) {
    WriteFileAtomically(path, [&](const std::filesystem::path& hidden) {
      WriteWholeFile(hidden, std::string_view(text));
    });
  };
  write(file.string() + "-metadata.json", TableMetadata(columns, file.filename().string()));
  write(file, TableText(columns, rows));
}

}  // namespace plumb
