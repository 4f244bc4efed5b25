// SPDX-License-Identifier: Apache-2.0
// What tests of backups compare: names, files and bytes.
#pragma once

#include <algorithm>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/files/file_io.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb::testing {

[[nodiscard]] inline std::vector<std::string> NamesIn(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    names.push_back(entry.path().filename());
  return names;
}

/// The files of a state folder, without the database, which is not byte for byte the same, what a
/// restore adds, and the key of the rows, which no backup holds.
/// @param but  Names of other files to leave out.
[[nodiscard]] inline auto FilesOfState(const std::filesystem::path& folder,
                                       std::initializer_list<std::string_view> but = {}) {
  auto files = testing::FilesBelow(folder);
  std::erase_if(files, [&](const auto& entry) {
    return entry.first.starts_with("plumb.db") || entry.first == "restored.json" ||
           entry.first == "last-scan" || entry.first == "rows.key" ||
           std::ranges::find(but, entry.first) != but.end();
  });
  return files;
}

[[nodiscard]] inline std::string ContentOf(const std::filesystem::path& file) {
  const auto bytes = ReadWholeFile(file, std::size_t{1} << 26);
  return {bytes.begin(), bytes.end()};
}

}  // namespace plumb::testing
