// SPDX-License-Identifier: Apache-2.0
// What `plumb` says about itself and about a wrong command line.
#include <cstdlib>

#include <gmock/gmock.h>

#include "algo/base/message.hpp"
#include "tests/integration/command_line.hpp"
#include "words/cli.hpp"
#include "words/scene_file.hpp"

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
  for (const char* command : {"simulate", "reconstruct", "compare", "mesh", "info", "import-dicom",
                              "export-dicom", "evaluate", "monitor"}) {
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
      {"monitor", "a"},
      {"monitor", "a", "--scene", "b"},
      {"mesh", "a"},
      {"import-dicom", "structures.dcm", "--out", "x"},
      {"import-dicom", "structures.dcm", "plan.dcm"},
      {"import-dicom", "plan.dcm", "--images", "ct", "--threshold", "300", "--out", "x"},
      {"import-dicom", "structures.dcm", "plan.dcm", "--threshold", "-500", "--out", "x"},
      {"export-dicom", "result", "--reference", "a", "--current", "b"},
      {"export-dicom", "result", "--reference", "a", "--out", "x"},
      {"export-dicom", "result", "--reference", "a", "--current", "b", "--out", "x",
       "--patient-name", "DOE^J\u202E"},
      {"send-dicom", "a.dcm"},
      {"send-dicom", "a.dcm", "--to", "ARCHIVE"},
      {"send-dicom", "a.dcm", "--to", "ARCHIVE@host:0"},
      {"send-dicom", "a.dcm", "--to", "ARCHIVE@host:104", "--from", "SEVENTEEN-LETTERS"},
      {"send-dicom", "a.dcm", "--to", "ARCHIVE@host:104", "--tls-key", "k.pem"},
      {"simulate", "--suite", "ct", "--out", "x", "--ct-quirk", "fax"},
      {"info"},
      {"info", "a", "--verbose"}};
  for (const auto& line : lines) {
    const RunResult result = Plumb(line);
    EXPECT_EQ(result.exit_code, 2) << testing::PrintToString(line);
    EXPECT_FALSE(result.err.empty()) << testing::PrintToString(line);
    EXPECT_EQ(result.out, "") << testing::PrintToString(line);
  }
}

TEST(UsageTest, SpeaksEachLanguage) {
  for (const Catalogue* language : Catalogues()) {
    const std::string code(language->code);
    const RunResult refusal = Plumb({"--language", code, "mesh", "/no/scene", "--out", "x.ply"});
    EXPECT_EQ(refusal.exit_code, 3);
    EXPECT_EQ(refusal.err,
              "plumb mesh: " + Text(say::scene_file::Missing("/no/scene"), *language) + "\n");
    const RunResult sheet = Plumb({"--language", code, "markers", "--out", "/no/folder/s.pdf"});
    EXPECT_EQ(sheet.exit_code, 1) << code;
    const RunResult usage = Plumb({"--language", code, "update"});
    EXPECT_EQ(usage.exit_code, 2);
    EXPECT_EQ(usage.err, "plumb update: " + Text(say::cli::NameABundle(), *language) + "\n");
  }
}

TEST(UsageTest, JsonIsTheSameInEachLanguage) {
  const std::string scene = SmallScene(SmallNames()[0]);
  const RunResult english = Plumb({"--language", "en", "info", scene, "--json"});
  EXPECT_EQ(english.exit_code, 0);
  for (const Catalogue* language : Catalogues()) {
    const RunResult other =
        Plumb({"--language", std::string(language->code), "info", scene, "--json"});
    EXPECT_EQ(other.out, english.out) << language->code;
  }
}

TEST(UsageTest, TheEnvironmentNamesTheLanguageWithoutTheOption) {
  const char* const set = std::getenv("LC_ALL");
  const std::string before = set != nullptr ? set : "";
  for (const Catalogue* language : Catalogues()) {
    ::setenv("LC_ALL", (std::string(language->code) + "_XX.UTF-8").c_str(), 1);
    EXPECT_THAT(Plumb({"update"}).err, HasSubstr(Text(say::cli::NameABundle(), *language)));
    EXPECT_THAT(Plumb({"--language", "en", "update"}).err,
                HasSubstr(say::cli::NameABundle().English()));
  }
  if (set != nullptr)
    ::setenv("LC_ALL", before.c_str(), 1);
  else
    ::unsetenv("LC_ALL");
}

TEST(UsageTest, AnUnknownLanguageIsRefusedWithThoseThatThereAre) {
  for (const char* code : {"xx", "", "EN", "english"}) {
    const RunResult result = Plumb({"--language", code, "update"});
    EXPECT_EQ(result.exit_code, 2) << code;
    EXPECT_EQ(result.out, "");
    for (const Catalogue* language : Catalogues())
      EXPECT_THAT(result.err, HasSubstr(std::string(language->code) + " (" +
                                        std::string(language->name) + ")"));
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
