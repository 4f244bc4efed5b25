// SPDX-License-Identifier: Apache-2.0
// The papers against the sources: files and functions that guides name, links, and what the README
// repeats of the manual.
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
      R"((?:algo|daemon|docs|drivers|systemd|tests|toolchain|web)(?:/[a-z0-9_.-]+)+/?)");
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
  for (const char* guide : {"CONTRIBUTING.md", "docs/extending.md"}) {
    const Checked checked = Check(TextOf(fs::path(PLUMB_SOURCE_DIR) / guide));
    EXPECT_THAT(checked.missing, ::testing::IsEmpty()) << guide;
    EXPECT_GE(checked.num_files, 20) << guide << ": far fewer means that nothing was read";
  }
  EXPECT_GE(Check(TextOf(fs::path(PLUMB_SOURCE_DIR) / "CONTRIBUTING.md")).num_names, 5);
}

TEST(DocumentsTest, AFileOrNameThatIsGoneIsFound) {
  EXPECT_THAT(Check("`algo/verdict/gates.cpp` (`Decide`) and `verdict.hpp`").missing,
              ::testing::IsEmpty());
  EXPECT_THAT(Check("`algo/verdict/judge.cpp`; `algo/verdict/gates.cpp` (`Resolve`), "
                    "`vertict.cpp`")
                  .missing,
              ::testing::ElementsAre("algo/verdict/judge.cpp", "algo/verdict/gates.cpp: Resolve",
                                     "algo/verdict/vertict.cpp"));
}

/// Every paper of the project, relative to its root.
std::vector<fs::path> Papers() {
  const fs::path root = PLUMB_SOURCE_DIR;
  std::vector<fs::path> papers;
  const auto add = [&](const fs::path& file) {
    if (file.extension() == ".md") papers.push_back(fs::relative(file, root));
  };
  for (const auto& entry : fs::directory_iterator(root)) add(entry.path());
  for (const char* top :
       {".github", "algo", "daemon", "docs", "drivers", "systemd", "tests", "toolchain", "web"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / top)) {
      if (entry.path().string().find("node_modules") == std::string::npos) add(entry.path());
    }
  }
  return papers;
}

/// Links and pictures of a paper that lead to nothing, wherever the paper is read.
std::vector<std::string> DeadLinks(const fs::path& paper, const std::string& text) {
  static const std::regex kLink(R"(\]\(([^)\s#]+)(?:#[^)]*)?\))");
  const fs::path root = PLUMB_SOURCE_DIR;
  std::vector<std::string> dead;
  for (std::sregex_iterator match(text.begin(), text.end(), kLink), end; match != end; ++match) {
    const std::string target = (*match)[1];
    if (target.find("://") != std::string::npos) continue;
    if (!fs::exists(root / paper.parent_path() / target)) dead.push_back(target);
  }
  return dead;
}

TEST(DocumentsTest, EveryLinkLeadsSomewhere) {
  const std::vector<fs::path> papers = Papers();
  EXPECT_GE(papers.size(), 30U) << "far fewer means that they were not found";
  for (const fs::path& paper : papers)
    EXPECT_THAT(DeadLinks(paper, TextOf(fs::path(PLUMB_SOURCE_DIR) / paper)), ::testing::IsEmpty())
        << paper;
  EXPECT_THAT(DeadLinks("docs/a.md", "[a](page.md#b), ![b](no.png) [c](https://e.org/f)"),
              ::testing::ElementsAre("no.png"));
}

std::vector<std::string> LinesOf(const fs::path& file) {
  std::ifstream in(file);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

TEST(DocumentsTest, TheReadmeIsShortAndItsFiguresAreThoseOfTheManual) {
  static const std::regex kFigure(R"(\d+\.\d+)");
  const fs::path root = PLUMB_SOURCE_DIR;
  const std::vector<std::string> readme = LinesOf(root / "README.md");
  EXPECT_LE(readme.size(), 150U);
  const std::string owner = TextOf(root / "docs/accuracy.md");
  int num_figures = 0;
  bool is_inside = false;
  for (const std::string& line : readme) {
    if (line.starts_with("## ")) is_inside = line == "## Accuracy";
    if (!is_inside || !line.starts_with('|')) continue;
    for (std::sregex_iterator match(line.begin(), line.end(), kFigure), end; match != end;
         ++match) {
      ++num_figures;
      EXPECT_NE(owner.find(match->str()), std::string::npos) << match->str() << " in: " << line;
    }
  }
  EXPECT_GE(num_figures, 20);
}

}  // namespace
}  // namespace plumb
