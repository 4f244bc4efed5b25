// SPDX-License-Identifier: Apache-2.0
// Lists of work: kills on the way, damaged items, and two processes on one list.
#include <sys/stat.h>

#include <algorithm>
#include <csignal>
#include <map>
#include <set>
#include <sstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "tests/integration/command_line.hpp"

namespace plumb {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using Json = nlohmann::json;

std::vector<Json> Lines(const std::string& out) {
  std::vector<Json> lines;
  std::istringstream text(out);
  for (std::string line; std::getline(text, line);) lines.push_back(Json::parse(line));
  return lines;
}

class BatchTest : public CommandLineTest {
 protected:
  void SetUp() override {
    CommandLineTest::SetUp();
    // Six frames each are enough for a scene, and short enough to make many.
    const fs::path suite = folder_ / "suite";
    ASSERT_EQ(Plumb({"simulate", "--suite", "demo", "--frames", "6", "--rate", "1", "--size",
                     "320x240", "--seed", "5", "--out", suite})
                  .exit_code,
              0);
    for (const auto& entry : fs::directory_iterator(suite / "recordings"))
      recordings_.push_back(entry.path());
    std::sort(recordings_.begin(), recordings_.end());
    ASSERT_GE(recordings_.size(), 2U);
  }

  fs::path List(const std::vector<std::string>& lines) {
    std::string text = "# recordings\n\n";
    for (const std::string& line : lines) text += line + "\n";
    WriteText(folder_ / "list", text);
    return folder_ / "list";
  }

  std::vector<std::string> Reconstruct(const fs::path& list) const {
    return {"reconstruct", "--list", list, "--out", folder_ / "scenes"};
  }

  /// Inode and time of each file of finished outputs.
  [[nodiscard]] std::map<std::string, std::pair<ino_t, std::int64_t>> Finished() const {
    std::map<std::string, std::pair<ino_t, std::int64_t>> files;
    if (!fs::exists(folder_ / "scenes")) return files;
    for (const auto& folder : fs::directory_iterator(folder_ / "scenes")) {
      if (!folder.is_directory() || folder.path().filename().string().starts_with('.')) continue;
      for (const auto& file : fs::directory_iterator(folder)) {
        struct stat status {};
        EXPECT_EQ(::stat(file.path().c_str(), &status), 0);
        files[file.path()] = {status.st_ino,
                              status.st_mtim.tv_sec * 1'000'000'000 + status.st_mtim.tv_nsec};
      }
    }
    return files;
  }

  /// Hidden folders and files of outputs that were never finished.
  [[nodiscard]] std::vector<std::string> Unfinished() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_ / "scenes"))
      if (entry.path().filename().string().find(".plumb-") != std::string::npos)
        names.push_back(entry.path().filename());
    return names;
  }

  static void ExpectSameScene(const fs::path& a, const fs::path& b) {
    std::set<std::string> names;
    for (const fs::path& scene : {a, b})
      for (const auto& entry : fs::directory_iterator(scene)) names.insert(entry.path().filename());
    for (const std::string& name : names) {
      if (name != "scene.json") {
        EXPECT_TRUE(ReadText(a / name) == ReadText(b / name)) << name << " differs";
        continue;
      }
      Json first = Json::parse(ReadText(a / name)), second = Json::parse(ReadText(b / name));
      first.erase("timings_s");
      second.erase("timings_s");
      EXPECT_EQ(first, second);
    }
  }

  std::vector<fs::path> recordings_;
};

TEST_F(BatchTest, AKilledRunGoesOnWhereItWas) {
  const fs::path list = List({recordings_[0], recordings_[1]});
  {
    Process run(PlumbCommand(Reconstruct(list)));
    // The first one is finished, the second one under way.
    ASSERT_TRUE(run.WaitForStdout("\"exit_code\":0")) << run.err();
    ASSERT_TRUE(run.WaitForStderr("2 of 2")) << run.err();
    run.Signal(SIGKILL);
    EXPECT_EQ(run.Wait(), -SIGKILL);
  }
  const auto before = Finished();
  ASSERT_FALSE(before.empty());
  // What a process leaves that is killed while it writes.
  const fs::path first = fs::path(before.begin()->first).parent_path();
  fs::create_directory(folder_ / "scenes" / ("." + first.filename().string() + ".plumb-1-0"));

  const RunResult again = Plumb(Reconstruct(list));
  ASSERT_EQ(again.exit_code, 0) << again.err;
  const std::vector<Json> lines = Lines(again.out);
  ASSERT_THAT(lines, SizeIs(2));
  EXPECT_EQ(lines[0]["reused"], true);
  EXPECT_EQ(lines[1]["reused"], false);
  EXPECT_THAT(Unfinished(), IsEmpty());
  const auto after = Finished();
  for (const auto& [file, identity] : before) EXPECT_EQ(after.at(file), identity) << file;
  const std::string table = ReadText(folder_ / "scenes" / "scenes.csv");

  // A run over finished work makes nothing, and the same table.
  EXPECT_EQ(Plumb(Reconstruct(list)).exit_code, 0);
  EXPECT_EQ(Finished(), after);
  EXPECT_EQ(ReadText(folder_ / "scenes" / "scenes.csv"), table);
  for (std::size_t i = 0; i < 2; ++i) {
    const fs::path alone = folder_ / fmt::format("alone{}", i);
    ASSERT_EQ(Plumb({"reconstruct", recordings_[i], "--out", alone, "--threads", "1"}).exit_code,
              0);
    ExpectSameScene(alone, lines[i]["output"].get<std::string>());
  }
}

TEST_F(BatchTest, ABrokenRecordingIsALineAndEqualOnesAreMadeOnce) {
  const fs::path broken = Copy(recordings_[0], "broken"), same = Copy(recordings_[0], "same");
  fs::remove(broken / "depth.txt");
  const RunResult run =
      Plumb(Reconstruct(List({broken, folder_ / "missing", recordings_[0], same})));
  EXPECT_EQ(run.exit_code, 3) << run.err;
  const std::vector<Json> lines = Lines(run.out);
  ASSERT_THAT(lines, SizeIs(4));
  EXPECT_EQ(lines[0]["exit_code"], 3);
  EXPECT_TRUE(lines[0]["output"].is_null());
  EXPECT_FALSE(lines[0]["error_message"]["id"].get<std::string>().empty());
  EXPECT_EQ(lines[1]["error_message"]["id"], "cli.no_input");
  EXPECT_EQ(lines[2]["exit_code"], 0);
  EXPECT_EQ(lines[2]["output"], lines[3]["output"]);
  EXPECT_EQ(lines[3]["reused"], true);
  const Json header = Json::parse(ReadText(folder_ / "scenes" / "scenes.csv-metadata.json"));
  EXPECT_EQ(header["url"], "scenes.csv");
  // Another method has another name.
  std::vector<std::string> paper = Reconstruct(List({recordings_[0]}));
  paper.insert(paper.end(), {"--preset", "paper"});
  const RunResult other = Plumb(paper);
  ASSERT_THAT(Lines(other.out), SizeIs(1)) << other.err;
  EXPECT_NE(Lines(other.out)[0]["output"], lines[2]["output"]);
}

TEST_F(BatchTest, TwoProcessesDoNothingTwice) {
  const fs::path list = List({recordings_[0], recordings_[1]});
  Process one(PlumbCommand(Reconstruct(list))), two(PlumbCommand(Reconstruct(list)));
  ASSERT_EQ(one.Wait(), 0) << one.err();
  ASSERT_EQ(two.Wait(), 0) << two.err();
  std::map<std::string, int> made;
  for (const std::string& out : {one.out(), two.out()}) {
    ASSERT_THAT(Lines(out), SizeIs(2));
    for (const Json& line : Lines(out)) made[line["output"]] += line["reused"] == false ? 1 : 0;
  }
  ASSERT_THAT(made, SizeIs(2));
  for (const auto& [output, times] : made) EXPECT_EQ(times, 1) << output;
  EXPECT_THAT(Unfinished(), IsEmpty());
}

TEST_F(BatchTest, PairsBecomeOneTable) {
  const RunResult made = Plumb(Reconstruct(List({recordings_[0], recordings_[1]})));
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const std::string reference = Lines(made.out)[0]["output"],
                    current = Lines(made.out)[1]["output"];
  const RunResult run = Plumb({"compare", "--list",
                               List({reference + "\t" + current,
                                     "'" + reference + "'  \"" + folder_.string() + "/no scene\""}),
                               "--out", folder_ / "results"});
  EXPECT_EQ(run.exit_code, 3) << run.err;
  const std::vector<Json> lines = Lines(run.out);
  ASSERT_THAT(lines, SizeIs(2));
  const fs::path output = lines[0]["output"].get<std::string>();
  const Json result = Json::parse(ReadText(output / "result.json"));
  EXPECT_EQ(lines[0]["verdict"], result["verdict"]);
  EXPECT_EQ(lines[1]["current"], folder_.string() + "/no scene");
  const std::string table = ReadText(folder_ / "results" / "results.csv");
  EXPECT_THAT(table, testing::StartsWith("reference,current,output,exit_code,verdict,error,"
                                         "vertical_mm,longitudinal_mm,lateral_mm,pitch_deg,"));
  EXPECT_THAT(table, HasSubstr(",u95_vertical_mm,"));
  EXPECT_THAT(table, HasSubstr(output.filename().string()));
  const Json header = Json::parse(ReadText(folder_ / "results" / "results.csv-metadata.json"));
  const std::string names = table.substr(0, table.find('\r'));
  std::string typed;
  for (const Json& column : header["tableSchema"]["columns"])
    typed += (typed.empty() ? "" : ",") + column["name"].get<std::string>();
  EXPECT_EQ(typed, names);
}

/// Suites of one list: killed, they go on with the scenes that are there; equal ones are done once.
TEST_F(BatchTest, SuitesOfAListAreEvaluatedOnce) {
  const fs::path suite = folder_ / "suite", same = Copy(suite, "same suite"),
                 broken = Copy(suite, "broken suite");
  fs::remove(broken / "truth" / "reference" / "motion.json");
  // What an earlier evaluation left there is not part of the suite.
  WriteText(same / "results-best", "figures");
  const std::vector<std::string> command = {"evaluate", "--list", List({suite, same, broken}),
                                            "--out", folder_};
  {
    Process run(PlumbCommand(command));
    ASSERT_TRUE(run.WaitForStderr("comparing")) << run.err();
    run.Signal(SIGKILL);
    EXPECT_EQ(run.Wait(), -SIGKILL);
  }
  const auto before = Finished();
  ASSERT_FALSE(before.empty());
  const RunResult again = Plumb(command);
  EXPECT_EQ(again.exit_code, 3) << again.err;
  const std::vector<Json> lines = Lines(again.out);
  ASSERT_THAT(lines, SizeIs(3));
  EXPECT_EQ(lines[0]["verdict"], "evaluated");
  EXPECT_EQ(lines[0]["reused"], false);
  EXPECT_EQ(lines[1]["reused"], true);
  EXPECT_EQ(lines[1]["output"], lines[0]["output"]);
  EXPECT_EQ(lines[2]["exit_code"], 3);
  EXPECT_THAT(lines[2]["error"].get<std::string>(), HasSubstr("motion.json"));
  const auto after = Finished();
  for (const auto& [file, identity] : before) EXPECT_EQ(after.at(file), identity) << file;
  EXPECT_THAT(Unfinished(), IsEmpty());
  for (const auto& entry : fs::directory_iterator(folder_))
    EXPECT_THAT(entry.path().filename().string(), testing::Not(HasSubstr(".plumb-")));
  // The scenes are those of a list of recordings with the same options.
  const RunResult scenes = Plumb(Reconstruct(List({recordings_[0], recordings_[1]})));
  ASSERT_THAT(Lines(scenes.out), SizeIs(2)) << scenes.err;
  for (const Json& line : Lines(scenes.out)) EXPECT_EQ(line["reused"], true);
  // The same figures as of the suite alone, but for times.
  const RunResult alone = Plumb({"evaluate", suite, "--out", folder_ / "alone", "--json"});
  ASSERT_EQ(alone.exit_code, 0) << alone.err;
  const fs::path output = lines[0]["output"].get<std::string>();
  const Json shared = Json::parse(ReadText(output / "evaluation.json"));
  EXPECT_EQ(shared["total"]["pairs"], Json::parse(alone.out)["total"]["pairs"]);
  EXPECT_THAT(ReadText(folder_ / "evaluations.csv"),
              testing::StartsWith("input,output,exit_code,verdict,error,suite,pairs,no_answer,"));
}

TEST_F(BatchTest, WrongListsAreRefusedBeforeAnyWork) {
  for (const auto& [text, says] : {std::pair("a b c\n", "line 1"), std::pair("# none\n", "nothing"),
                                   std::pair("x 'y\n", "line 1")}) {
    WriteText(folder_ / "list", text);
    const RunResult run =
        Plumb({"compare", "--list", folder_ / "list", "--out", folder_ / "results"});
    EXPECT_EQ(run.exit_code, 3) << text;
    EXPECT_THAT(run.err, HasSubstr(says)) << text;
  }
  EXPECT_EQ(Plumb({"reconstruct", "--out", folder_ / "results"}).exit_code, 2);
  EXPECT_EQ(Plumb({"compare", recordings_[0], "--out", folder_ / "results"}).exit_code, 2);
  EXPECT_EQ(Plumb({"evaluate"}).exit_code, 2);
  EXPECT_EQ(Plumb({"evaluate", "--list", folder_ / "list"}).exit_code, 2);
  EXPECT_FALSE(fs::exists(folder_ / "results"));
}

}  // namespace
}  // namespace plumb
