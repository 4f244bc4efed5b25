// SPDX-License-Identifier: Apache-2.0
// No folder of the product becomes one in which nothing is found any more.
#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>

#include <gtest/gtest.h>

namespace plumb {
namespace {

const std::filesystem::path kRoot = PLUMB_SOURCE_DIR;
constexpr int kMostFiles = 40, kMostLines = 4000;

struct FolderSize {
  int num_files = 0, num_lines = 0;
};

/// Of a folder's own sources, without those of the folders below it.
std::map<std::string, FolderSize> SizesOfFolders() {
  constexpr std::array kKinds = {".cpp", ".hpp", ".js", ".mjs", ".css", ".html"};
  std::map<std::string, FolderSize> sizes;
  for (const char* top : {"algo", "daemon", "drivers", "web", "systemd"}) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(kRoot / top)) {
      if (!entry.is_regular_file() ||
          std::ranges::find(kKinds, entry.path().extension().string()) == kKinds.end())
        continue;
      FolderSize& size =
          sizes[entry.path().parent_path().lexically_relative(kRoot).generic_string()];
      ++size.num_files;
      std::ifstream source(entry.path());
      size.num_lines += static_cast<int>(std::count(std::istreambuf_iterator<char>(source),
                                                    std::istreambuf_iterator<char>(), '\n'));
    }
  }
  return sizes;
}

TEST(FolderSizeTest, NoFolderHasMoreThanAReaderFindsTheirWayIn) {
  const std::map<std::string, FolderSize> sizes = SizesOfFolders();
  EXPECT_GT(sizes.size(), 50U) << "they are no longer seen";
  for (const auto& [folder, size] : sizes) {
    EXPECT_LE(size.num_files, kMostFiles) << folder << ": give a part of it a folder of its own";
    EXPECT_LE(size.num_lines, kMostLines) << folder << ": give a part of it a folder of its own";
  }
}

}  // namespace
}  // namespace plumb
