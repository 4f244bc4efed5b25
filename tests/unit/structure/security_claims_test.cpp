// SPDX-License-Identifier: Apache-2.0
// docs/threats.md names a test for each control: they must exist.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace plumb {
namespace {

namespace fs = std::filesystem;

std::string TextOf(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<std::vector<std::string>> Matches(const std::string& text, const std::regex& what) {
  std::vector<std::vector<std::string>> found;
  for (std::sregex_iterator match(text.begin(), text.end(), what), end; match != end; ++match)
    found.push_back({(*match)[1], (*match)[2]});
  return found;
}

/// "Suite.Name" of every test that is written in C++, and of the scripts that ctest runs.
std::set<std::string> ExistingTests() {
  static const std::regex kTest(R"(TEST(?:_F|_P)?\(\s*(\w+),\s*(\w+)\))");
  static const std::regex kScript(R"(add_test\(NAME (\w+)\.(\w+))");
  std::set<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(PLUMB_SOURCE_DIR "/tests")) {
    const bool is_script = entry.path().filename() == "CMakeLists.txt";
    if (!is_script && entry.path().extension() != ".cpp") continue;
    for (const auto& match : Matches(TextOf(entry.path()), is_script ? kScript : kTest))
      names.insert(match[0] + "." + match[1]);
  }
  return names;
}

/// The rows of the tables of threats and hazards whose last column is named "test".
std::vector<std::string> RowsWithTests() {
  std::ifstream in(PLUMB_SOURCE_DIR "/docs/threats.md");
  std::vector<std::string> rows;
  bool is_inside = false;
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with('|')) is_inside = false;
    if (line.ends_with("| test |")) {
      is_inside = true;
    } else if (is_inside && !line.starts_with("|---")) {
      rows.push_back(line);
    }
  }
  return rows;
}

TEST(SecurityClaimsTest, EveryControlNamesTestsThatExist) {
  static const std::regex kName(R"(`(\w+)\.(\w+)`)");
  const std::set<std::string> existing = ExistingTests();
  EXPECT_GT(existing.size(), 500U) << "the sources of the tests are read";
  const std::vector<std::string> rows = RowsWithTests();
  EXPECT_GT(rows.size(), 35U) << "both tables are read";
  for (const std::string& row : rows) {
    const std::string last = row.substr(row.rfind('|', row.size() - 2));
    const auto named = Matches(last, kName);
    EXPECT_FALSE(named.empty()) << "no test: " << row;
    for (const auto& name : named)
      EXPECT_TRUE(existing.contains(name[0] + "." + name[1])) << name[0] << '.' << name[1];
  }
}

TEST(SecurityClaimsTest, EveryHazardThatMattersHasARow) {
  const std::string text = TextOf(PLUMB_SOURCE_DIR "/docs/threats.md");
  for (const char* hazard : {"wrong side", "stale result", "wrong patient", "wrong reference",
                             "moved marker", "overconfidence", "lost data"}) {
    EXPECT_NE(text.find(std::string("\n| ") + hazard + " |"), std::string::npos) << hazard;
  }
}

}  // namespace
}  // namespace plumb
