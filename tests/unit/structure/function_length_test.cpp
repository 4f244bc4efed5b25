// SPDX-License-Identifier: Apache-2.0
// Functions that nobody can see as a whole.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/unit/structure/source_text.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr int kMostLinesOfFunction = 60;

// Longer ones, each with the reason. No new ones: one that is short now must go from here too.
const std::map<std::string, std::string> kLong = {
    {"AddScene in daemon/python/module.cpp", "a table: one line for each name in Python"},
    {"AddComparison in daemon/python/module.cpp", "a table: one line for each name in Python"},
    {"Intersect in drivers/simulator/world/distance_grid_rays.cpp",
     "one loop whose twelve vectors stay in registers: most of the simulator's time"},
};

struct Function {
  std::string name;
  int num_lines = 0;  ///< From its first line to its closing brace, comments included.
};

// The functions of a source that are defined in a namespace or a class.
std::vector<Function> FunctionsOf(std::string_view source) {
  const std::string code = CodeOnly(source);
  std::vector<Function> functions;
  std::vector<bool> scopes;  // whether each open brace is a namespace's or a class's
  std::string text;          // since the last statement's end
  int line = 1, first_line = 1, round = 0, depth_of_function = 0;
  const auto end_statement = [&] { text.clear(); };
  for (std::size_t i = 0; i < code.size(); ++i) {
    const char c = code[i];
    if (c == '\n') ++line;
    if (depth_of_function > 0) {
      depth_of_function += (c == '{' ? 1 : 0) - (c == '}' ? 1 : 0);
      if (depth_of_function == 0) {
        functions.back().num_lines = line - first_line + 1;
        end_statement();
      }
      continue;
    }
    if (text.find_first_not_of(" \n") == std::string::npos && c != ' ' && c != '\n')
      first_line = line;
    round += (c == '(' ? 1 : 0) - (c == ')' ? 1 : 0);
    if (round == 0 && c == ';') {
      end_statement();
    } else if (round == 0 && c == '{') {
      const std::size_t open = text.find('(');
      const bool is_value = text.substr(0, open).find('=') != std::string::npos &&
                            text.find("operator") == std::string::npos;
      if (open == std::string::npos || is_value) {
        scopes.push_back(true);
        // The braces of a value do not end the statement, but nothing in them is a function.
        if (text.find('=') == std::string::npos) end_statement();
      } else if (text.find(") :") != std::string::npos && code[i - 1] != ' ') {
        scopes.push_back(true);  // a member that a constructor initialises
      } else {
        std::string_view before = std::string_view(text).substr(0, open);
        functions.push_back({LastWord(before), 0});
        depth_of_function = 1;
      }
    } else if (round == 0 && c == '}') {
      if (!scopes.empty()) scopes.pop_back();
      if (text.find(") :") == std::string::npos) end_statement();
    } else if (c == ':' && (text.ends_with("public") || text.ends_with("private") ||
                            text.ends_with("protected"))) {
      end_statement();
    } else {
      text += c;
    }
  }
  return functions;
}

TEST(FunctionLengthTest, WhatDoesNotFitOnAScreenHasAReason) {
  const fs::path root = PLUMB_SOURCE_DIR;
  std::map<std::string, std::string> found;
  std::size_t num_functions = 0;
  for (const char* top : {"algo", "drivers", "web", "daemon"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / top)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".cpp" && extension != ".hpp") continue;
      std::ifstream file(entry.path());
      const std::string source{std::istreambuf_iterator<char>(file), {}};
      const std::string path = fs::relative(entry.path(), root).string();
      for (const Function& one : FunctionsOf(source)) {
        ++num_functions;
        if (one.num_lines <= kMostLinesOfFunction) continue;
        const std::string name = one.name + " in " + path;
        const auto known = kLong.find(name);
        found[name] = known != kLong.end() ? known->second : std::to_string(one.num_lines);
      }
    }
  }
  ASSERT_GT(num_functions, 2000U) << "far fewer means that nothing was read";
  EXPECT_EQ(found, kLong) << "split it, or state here why it is better whole";
}

TEST(FunctionLengthTest, TheLinesOfAFunctionAreCounted) {
  const std::vector<Function> functions = FunctionsOf(R"source(
namespace a {
const std::map<int, int> kTable = {{1, 2},
                                   {3, 4}};
/// Not counted.
int One(int a,
        const std::vector<int>& b = {}) {
  // counted
  /* and
     this */
  return b.empty() ? a : 0;
}
class B : public C {
 public:
  B() : a_{1}, b_(2) {
    Begin();
  }
  int Two() const override { return 2; }
  bool operator==(const B& other) const {
    return true;
  }

 private:
  int a_ = 0, b_{};
};
auto kWork = [](int a) {
  return a;
};
B::B(int) try : a_(1) {
  if (a_) {
  }
} catch (...) {
}
}
)source");
  std::vector<std::pair<std::string, int>> counted;
  for (const Function& one : functions) counted.emplace_back(one.name, one.num_lines);
  EXPECT_THAT(counted,
              ::testing::IsSupersetOf(
                  {std::pair<std::string, int>{"One", 7}, {"B", 3}, {"Two", 1}, {"operator", 3}}));
}

}  // namespace
}  // namespace plumb
