// SPDX-License-Identifier: Apache-2.0
// Every source states its licence in its first lines.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// Whether the file is a source: by its name, or as a script.
bool IsSource(const fs::path& file) {
  static const std::set<std::string> kExtensions = {".cpp",  ".hpp",   ".js", ".mjs", ".css",
                                                    ".html", ".cmake", ".py", ".pyi", ".sh"};
  std::string extension = file.extension().string();
  if (extension == ".in") extension = file.stem().extension().string();
  if (kExtensions.contains(extension) || file.filename() == "CMakeLists.txt") return true;
  std::ifstream in(file, std::ios::binary);
  return in.get() == '#' && in.get() == '!';
}

/// Whether one of the first three lines, below `#!` and `<!doctype>`, states the licence.
bool StatesLicence(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  for (int i = 0; i < 3 && std::getline(in, line); ++i)
    if (line.find("SPDX-License-Identifier: Apache-2.0") != std::string::npos) return true;
  return false;
}

TEST(LicenceTest, EverySourceStatesIt) {
  const fs::path root = PLUMB_SOURCE_DIR;
  std::vector<std::string> without;
  int num_sources = 0;
  const auto check = [&](const fs::path& file) {
    if (!fs::is_regular_file(file) || !IsSource(file)) return;
    ++num_sources;
    if (!StatesLicence(file)) without.push_back(fs::relative(file, root).string());
  };
  check(root / "CMakeLists.txt");
  for (const char* top :
       {".ci", "algo", "daemon", "docs", "drivers", "systemd", "tests", "toolchain", "web"}) {
    for (auto entry = fs::recursive_directory_iterator(root / top);
         entry != fs::recursive_directory_iterator(); ++entry) {
      const std::string name = entry->path().filename().string();
      if (name == "node_modules" || name == "__pycache__") entry.disable_recursion_pending();
      check(entry->path());
    }
  }
  EXPECT_GT(num_sources, 1000) << "far fewer means that they were not found";
  EXPECT_THAT(without, ::testing::IsEmpty());
}

}  // namespace
}  // namespace plumb
