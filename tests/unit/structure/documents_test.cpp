// The files and functions that the guides name, against the sources.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <string>
#include <vector>

namespace plumb {
namespace {

namespace fs = std::filesystem;

std::string TextOf(const fs::path& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

/// What a guide names and the sources do not have. A file without a folder lies in the folder
/// that was named last; `file` (`Name`) says that the file holds the name. What is to be chosen,
/// as NAME in `drivers/NAME/`, is left out.
struct Checked {
  std::vector<std::string> missing;
  int num_files = 0;
  int num_names = 0;
};
Checked Check(const std::string& guide) {
  static const std::regex kQuoted(R"((\(?)`([^`\n]+)`)");
  static const std::regex kPath(
      R"((?:algo|daemon|drivers|systemd|tests|toolchain|web)(?:/[a-z0-9_.-]+)+/?)");
  static const std::regex kFile(R"([a-z0-9_]+\.(?:cpp|hpp))");
  static const std::regex kName("[A-Za-z_]+");
  const fs::path root = PLUMB_SOURCE_DIR;
  Checked checked;
  fs::path last;
  for (std::sregex_iterator match(guide.begin(), guide.end(), kQuoted), end; match != end;
       ++match) {
    const std::string quoted = (*match)[2];
    const bool in_brackets = (*match)[1].length() > 0;
    if (std::regex_match(quoted, kPath) || (!last.empty() && std::regex_match(quoted, kFile))) {
      const fs::path folder = fs::is_directory(root / last) ? last : last.parent_path();
      last = std::regex_match(quoted, kPath) ? fs::path(quoted) : folder / quoted;
      ++checked.num_files;
      if (!fs::exists(root / last)) checked.missing.push_back(last.string());
    } else if (in_brackets && fs::is_regular_file(root / last) && std::regex_match(quoted, kName) &&
               !quoted.ends_with("Test") && quoted != "WebCatalogue") {
      ++checked.num_names;
      if (TextOf(root / last).find(quoted) == std::string::npos)
        checked.missing.push_back(last.string() + ": " + quoted);
    }
  }
  return checked;
}

TEST(DocumentsTest, WhatTheGuidesNameIsThere) {
  for (const char* guide : {"CONTRIBUTING.md", "toolchain/site/extending.md"}) {
    const Checked checked = Check(TextOf(fs::path(PLUMB_SOURCE_DIR) / guide));
    EXPECT_THAT(checked.missing, ::testing::IsEmpty()) << guide;
    EXPECT_GE(checked.num_files, 20) << guide << ": far fewer means that nothing was read";
  }
  EXPECT_GE(Check(TextOf(fs::path(PLUMB_SOURCE_DIR) / "CONTRIBUTING.md")).num_names, 5);
}

TEST(DocumentsTest, AFileOrNameThatIsGoneIsFound) {
  EXPECT_THAT(Check("`algo/acceptance/acceptance.cpp` (`Decide`) and `verdict.hpp`").missing,
              ::testing::IsEmpty());
  EXPECT_THAT(
      Check("`algo/acceptance/gates.cpp`; `algo/acceptance/acceptance.cpp` (`Resolve`), "
            "`vertict.cpp`")
          .missing,
      ::testing::ElementsAre("algo/acceptance/gates.cpp", "algo/acceptance/acceptance.cpp: Resolve",
                             "algo/acceptance/vertict.cpp"));
}

}  // namespace
}  // namespace plumb
