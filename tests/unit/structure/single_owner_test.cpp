// SPDX-License-Identifier: Apache-2.0
// Numbers and small tasks that have one owner in the product's sources.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr double kMarkerLength_m = 0.104;

// Whether the line has the number, however it is written.
bool Spells(const std::string& line, double number) {
  static const std::regex kNumber(R"((^|[^\w.])((\d+\.\d*|\.\d+|\d+(?=[eE]))([eE][-+]?\d+)?))");
  for (std::sregex_iterator match(line.begin(), line.end(), kNumber), end; match != end; ++match)
    if (std::strtod((*match)[2].str().c_str(), nullptr) == number) return true;
  return false;
}

// "FILE:LINE" of each line of the product's sources that `is_meant` accepts.
// @param others  Files in which the same text means something else.
std::vector<std::string> LinesThat(const std::function<bool(const std::string&)>& is_meant,
                                   const std::set<std::string>& others) {
  const fs::path root = PLUMB_SOURCE_DIR;
  std::vector<std::string> found;
  std::size_t num_files = 0;
  for (const char* top : {"algo", "drivers", "web", "daemon"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / top)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".cpp" && extension != ".hpp" && extension != ".js") continue;
      const std::string file = fs::relative(entry.path(), root).string();
      if (others.contains(file)) continue;
      ++num_files;
      std::ifstream source(entry.path());
      int number = 0;
      for (std::string line; std::getline(source, line);) {
        ++number;
        if (is_meant(line)) found.push_back(file + ":" + std::to_string(number));
      }
    }
  }
  EXPECT_GT(num_files, 500U) << "far fewer means that nothing was read";
  return found;
}

std::function<bool(const std::string&)> Has(const char* text) {
  return [text](const std::string& line) { return line.find(text) != std::string::npos; };
}

TEST(SingleOwnerTest, TheDefaultLengthOfMarkersIsWrittenOnce) {
  // A body's coordinates have nothing to do with it.
  EXPECT_THAT(LinesThat([](const std::string& line) { return Spells(line, kMarkerLength_m); },
                        {"drivers/simulator/world/body.cpp"}),
              ::testing::ElementsAre(::testing::StartsWith("algo/types/marker.hpp:")))
      << "use kDefaultMarkerLength_m, or let the caller state the room's length";
}

TEST(SingleOwnerTest, TheDefaultDictionaryOfMarkersIsWrittenOnce) {
  // The table of all dictionaries, and the markers that the simulator prints.
  EXPECT_THAT(LinesThat(Has("\"DICT_6X6_250\""),
                        {"algo/types/marker_dictionary.cpp", "drivers/simulator/world/world.hpp"}),
              ::testing::ElementsAre(::testing::StartsWith("algo/types/marker.hpp:")))
      << "use kDefaultMarkerDictionary";
}

TEST(SingleOwnerTest, BytesBecomeTextInOnePlace) {
  EXPECT_THAT(LinesThat(Has("bin2base64("), {}), ::testing::IsEmpty()) << "use ToBase64()";
}

TEST(SingleOwnerTest, SmallLettersAreMadeInOnePlace) {
  // Compares letters without making any.
  EXPECT_THAT(LinesThat(Has("tolower("), {"algo/types/marker_dictionary.cpp"}),
              ::testing::IsEmpty())
      << "use AsciiLower()";
}

TEST(SingleOwnerTest, ANumberIsFoundHoweverItIsWritten) {
  for (const char* line : {"double a = 0.104;", "{.length_m = .104}", "f(104e-3, 2)",
                           "x = 0.1040F;", "a*1.04e-01", "0.104"})
    EXPECT_TRUE(Spells(line, kMarkerLength_m)) << line;
  for (const char* line : {"0.1042", "10.104", "0.1041", "v0.104", "104", "1.0.104"})
    EXPECT_FALSE(Spells(line, kMarkerLength_m)) << line;
}

}  // namespace
}  // namespace plumb
