// What `plumb` says about itself and about a wrong command line.
#include <gmock/gmock.h>

#include "tests/integration/command_line.hpp"

namespace plumb {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

TEST(UsageTest, TellsItsVersion) {
  const RunResult result = Plumb({"--version"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.out, StartsWith("plumb "));
}

TEST(UsageTest, HelpListsEveryCommandAndCarriesTheNotice) {
  const RunResult result = Plumb({"--help"});
  EXPECT_EQ(result.exit_code, 0);
  for (const char* command : {"simulate", "reconstruct", "compare", "mesh", "info", "evaluate"}) {
    EXPECT_THAT(result.out, HasSubstr(command));
    const RunResult help = Plumb({command, "--help"});
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_THAT(help.out, HasSubstr(std::string("Usage: plumb ") + command));
  }
  EXPECT_THAT(result.out, HasSubstr("Research use only"));
}

TEST(UsageTest, WrongLinesEndWithTwo) {
  const std::vector<std::vector<std::string>> lines = {
      {},
      {"recnstruct"},
      {"reconstruct"},
      {"reconstruct", "somewhere"},
      {"reconstruct", "somewhere", "--out", "x", "--preset", "fast"},
      {"compare", "a", "b"},
      {"compare", "a", "b", "--out", "c", "--isocentre", "1", "2"},
      {"compare", "a", "b", "--out", "c", "--isocentre", "1", "2", "x"},
      {"simulate", "--suite", "ten", "--out", "x"},
      {"simulate", "--suite", "demo", "--out", "x", "--noise", "none"},
      {"simulate", "--suite", "demo", "--out", "x", "--frames", "-3"},
      {"mesh", "a"},
      {"info"},
      {"info", "a", "--verbose"}};
  for (const auto& line : lines) {
    const RunResult result = Plumb(line);
    EXPECT_EQ(result.exit_code, 2) << testing::PrintToString(line);
    EXPECT_FALSE(result.err.empty()) << testing::PrintToString(line);
    EXPECT_EQ(result.out, "") << testing::PrintToString(line);
  }
}

TEST(UsageTest, AReportThatQuotesAPathInAnyEncodingIsJson) {
  const RunResult result = Plumb({"doctor", "--json", "--config", "/nonexistent/\xff.toml"});
  EXPECT_THAT(result.out, HasSubstr("/nonexistent/\xEF\xBF\xBD.toml"));
  EXPECT_EQ(result.out.back(), '\n');
}

TEST(UsageTest, AClosedOrFullStandardOutputIsAnError) {
  const RunResult result =
      Plumb({"info", SmallRecording(SmallNames()[0])}, {.stdout_path = "/dev/full"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("standard output"));
}

}  // namespace
}  // namespace plumb
