// SPDX-License-Identifier: Apache-2.0
// Interruptions, full disks, foreign folders, damaged scenes, and the same bytes every time.
#include <sys/stat.h>

#include <csignal>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "tests/integration/command_line.hpp"

namespace plumb {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

const std::string& ReferenceName() { return SmallNames()[0]; }

class RobustnessTest : public CommandLineTest {
 protected:
  /// Everything of a scene but the timings, which no run repeats.
  static std::map<std::string, std::string> Bytes(const fs::path& scene) {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::directory_iterator(scene))
      files[entry.path().filename().string()] = ReadText(entry.path());
    auto facts = nlohmann::json::parse(files.at("scene.json"));
    facts.erase("timings_s");
    files["scene.json"] = facts.dump();
    return files;
  }

  void ExpectSame(const fs::path& a, const fs::path& b) {
    const auto first = Bytes(a), second = Bytes(b);
    ASSERT_EQ(first.size(), second.size());
    for (const auto& [name, bytes] : first)
      EXPECT_TRUE(second.contains(name) && second.at(name) == bytes) << name << " differs";
  }
};

TEST_F(RobustnessTest, TwoRunsGiveTheSameBytes) {
  ASSERT_EQ(
      Plumb({"reconstruct", SmallRecording(ReferenceName()), "--out", folder_ / "again"}).exit_code,
      0);
  ExpectSame(SmallScene(ReferenceName()), folder_ / "again");
}

TEST_F(RobustnessTest, OneProcessorGivesTheSameBytesAsTwo) {
  ASSERT_EQ(Plumb({"reconstruct", SmallRecording(ReferenceName()), "--out", folder_ / "one"},
                  {.num_cpus = 1})
                .exit_code,
            0);
  ASSERT_EQ(Plumb({"reconstruct", SmallRecording(ReferenceName()), "--out", folder_ / "two"},
                  {.num_cpus = 2})
                .exit_code,
            0);
  ExpectSame(folder_ / "one", folder_ / "two");
}

TEST_F(RobustnessTest, ThePaperPresetRepeatsToo) {
  for (const auto& [name, cpus] : {std::pair("one", 1), std::pair("two", 2)}) {
    ASSERT_EQ(Plumb({"reconstruct", SmallRecording(ReferenceName()), "--out", folder_ / name,
                     "--preset", "paper"},
                    {.num_cpus = cpus})
                  .exit_code,
              0);
  }
  ExpectSame(folder_ / "one", folder_ / "two");
}

TEST_F(RobustnessTest, TheSimulatorRepeats) {
  for (const auto& [name, cpus] : {std::pair("one", 1), std::pair("two", 2)}) {
    const RunResult made = Plumb({"simulate", "--suite", "demo", "--frames", "3", "--size",
                                  "320x240", "--out", folder_ / name},
                                 {.num_cpus = cpus});
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "one")) {
    if (!entry.is_regular_file()) continue;
    const fs::path other = folder_ / "two" / fs::relative(entry.path(), folder_ / "one");
    EXPECT_EQ(ReadText(entry.path()), ReadText(other)) << other;
  }
}

TEST_F(RobustnessTest, CtrlCEndsWith130AndLeavesNothing) {
  struct Case {
    std::vector<std::string> arguments;
    const char* started;  ///< Printed once the work is under way.
    int signal;
  };
  const std::vector<Case> cases = {
      {{"reconstruct", SmallRecording(ReferenceName()), "--out", folder_ / "scene"},
       "tracking",
       SIGINT},
      {{"reconstruct", SmallRecording(ReferenceName()), "--out", folder_ / "scene"},
       "tracking",
       SIGTERM},
      {{"reconstruct", SmallRecording(ReferenceName()), "--out", folder_ / "scene", "--preset",
        "paper"},
       "tracking",
       SIGINT},
      {{"reconstruct", SmallRecording(ReferenceName()), "--out", folder_ / "scene", "--realtime"},
       "tracking",
       SIGINT},
      {{"simulate", "--suite", "nine", "--out", folder_ / "suite"}, "simulating", SIGINT},
  };
  for (const Case& c : cases) {
    Process process(PlumbCommand(c.arguments));
    ASSERT_TRUE(process.WaitForStderr(c.started)) << process.err();
    process.Signal(c.signal);
    EXPECT_EQ(process.Wait(), 130) << process.err();
    EXPECT_EQ(process.out(), "");
    EXPECT_THAT(LeftBehind({}), IsEmpty()) << testing::PrintToString(c.arguments);
  }
}

TEST_F(RobustnessTest, AnInterruptedEvaluationLeavesNoHalfScene) {
  Process process(PlumbCommand({"evaluate", SmallSuite(), "--out", folder_ / "out"}));
  ASSERT_TRUE(process.WaitForStderr("tracking")) << process.err();
  process.Signal(SIGINT);
  EXPECT_EQ(process.Wait(), 130) << process.err();
  for (const auto& entry : fs::recursive_directory_iterator(folder_))
    EXPECT_FALSE(entry.is_regular_file()) << entry.path();
}

/// Of markers.pdf and its folder: first the bytes, then the name, then the folder that holds it.
TEST_F(RobustnessTest, ASingleFileIsOnTheDiskBeforeItHasItsName) {
  const fs::path file = folder_ / "markers.pdf", log = folder_ / "synced";
  const RunResult result =
      plumb::Run({"/usr/bin/env", "LD_PRELOAD=" PLUMB_SYNC_LOG, "PLUMB_SYNC_LOG=" + log.string(),
                  PLUMB_BINARY, "markers", "--ids", "0-1", "--out", file});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto inode_of = [](const fs::path& path) {
    struct stat status {};
    EXPECT_EQ(::stat(path.c_str(), &status), 0) << path;
    return std::to_string(status.st_ino);
  };
  const std::string written = ReadText(log);
  const std::size_t bytes =
      written.find("fsync " + inode_of(file) + " " + std::to_string(fs::file_size(file)) + "\n");
  const std::size_t named = written.find(" " + file.string() + "\n", written.find("rename "));
  const std::size_t listed = written.rfind("fsync " + inode_of(folder_) + " ");
  ASSERT_NE(bytes, std::string::npos) << written;
  ASSERT_NE(named, std::string::npos) << written;
  ASSERT_NE(listed, std::string::npos) << written;
  EXPECT_LT(bytes, named) << written;
  EXPECT_LT(named, listed) << written;
}

TEST_F(RobustnessTest, AFullDiskIsExitOneAndLeavesNothing) {
  // The largest file of a scene is some megabytes; RLIMIT_FSIZE fails the write as a full disk
  // does.
  const RunResult scene =
      Plumb({"reconstruct", SmallRecording(ReferenceName()), "--out", folder_ / "scene"},
            {.max_file_bytes = 100'000});
  EXPECT_EQ(scene.exit_code, 1) << scene.err;
  EXPECT_THAT(scene.err, HasSubstr("cannot write"));
  const RunResult result = Plumb({"compare", SmallScene(ReferenceName()),
                                  SmallScene(ReferenceName()), "--out", folder_ / "result"},
                                 {.max_file_bytes = 100'000});
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_EQ(Plumb({"mesh", SmallScene(ReferenceName()), "--out", folder_ / "mesh.ply"},
                  {.max_file_bytes = 100'000})
                .exit_code,
            1);
  EXPECT_EQ(Plumb({"simulate", "--suite", "demo", "--frames", "3", "--size", "320x240", "--out",
                   folder_ / "suite"},
                  {.max_file_bytes = 1000})
                .exit_code,
            1);
  EXPECT_THAT(LeftBehind({}), IsEmpty());
}

TEST_F(RobustnessTest, AForeignFolderIsNeverReplaced) {
  fs::create_directory(folder_ / "mine");
  WriteText(folder_ / "mine" / "thesis.tex", "years of work");
  EXPECT_NE(
      Plumb({"reconstruct", SmallRecording(ReferenceName()), "--out", folder_ / "mine"}).exit_code,
      0);
  EXPECT_NE(Plumb({"compare", SmallScene(ReferenceName()), SmallScene(ReferenceName()), "--out",
                   folder_ / "mine"})
                .exit_code,
            0);
  EXPECT_NE(
      Plumb({"simulate", "--suite", "demo", "--frames", "3", "--out", folder_ / "mine"}).exit_code,
      0);
  EXPECT_EQ(ReadText(folder_ / "mine" / "thesis.tex"), "years of work");
  EXPECT_THAT(LeftBehind({"mine"}), IsEmpty());
}

TEST_F(RobustnessTest, AnOlderOutputIsReplaced) {
  const fs::path scene = Copy(SmallScene(ReferenceName()), "scene");
  WriteText(scene / "trajectory.txt", "old");
  ASSERT_EQ(Plumb({"reconstruct", SmallRecording(ReferenceName()), "--out", scene}).exit_code, 0);
  EXPECT_NE(ReadText(scene / "trajectory.txt"), "old");
  EXPECT_THAT(LeftBehind({"scene"}), IsEmpty());
}

TEST_F(RobustnessTest, DamagedScenesAreRefused) {
  const auto refused = [this](const std::string& name,
                              const std::function<void(const fs::path&)>& damage,
                              const std::string& message) {
    const fs::path scene = Copy(SmallScene(ReferenceName()), name);
    damage(scene);
    const RunResult result =
        Plumb({"compare", SmallScene(ReferenceName()), scene, "--out", folder_ / "result"});
    EXPECT_EQ(result.exit_code, 3) << name << ": " << result.err;
    EXPECT_THAT(result.err, HasSubstr(message)) << name;
    EXPECT_FALSE(fs::exists(folder_ / "result")) << name;
    fs::remove_all(scene);
  };
  const auto edit = [](const char* key, const nlohmann::json& value) {
    return [=](const fs::path& scene) {
      auto facts = nlohmann::json::parse(ReadText(scene / "scene.json"));
      facts[key] = value;
      WriteText(scene / "scene.json", facts.dump());
    };
  };
  const auto halve = [](const char* file) {
    return [=](const fs::path& scene) {
      fs::resize_file(scene / file, fs::file_size(scene / file) / 2);
    };
  };
  refused("newer", edit("format", 2), "format");
  refused(
      "no-json", [](const fs::path& scene) { WriteText(scene / "scene.json", "{"); }, "scene.json");
  refused("other-dictionary", edit("marker_dictionary", "DICT_4X4_50"), "DICT_4X4_50");
  refused("other-length", edit("marker_length_m", 0.2), "0.2");
  refused("short-map", halve("heightmap.tiff"), "heightmap.tiff");
  refused("short-cloud", halve("cloud.ply"), "cloud.ply");
  refused("short-sensitivity", halve("sensitivity.json"), "sensitivity.json");
  refused(
      "no-map", [](const fs::path& scene) { fs::remove(scene / "heightmap.tiff"); },
      "heightmap.tiff");
  refused(
      "nan-pose",
      [](const fs::path& scene) {
        std::string text = ReadText(scene / "trajectory.txt");
        const std::size_t at = text.find(' ', text.find('\n') + 1) + 1;
        text.replace(at, text.find(' ', at) - at, "nan");
        WriteText(scene / "trajectory.txt", text);
      },
      "trajectory.txt");
  EXPECT_THAT(LeftBehind({}), IsEmpty());
}

TEST_F(RobustnessTest, ASuiteThatIsNoneIsBadInput) {
  EXPECT_EQ(Plumb({"evaluate", folder_}).exit_code, 3);
  EXPECT_EQ(Plumb({"evaluate", folder_ / "nowhere"}).exit_code, 3);
  EXPECT_THAT(LeftBehind({}), IsEmpty());
}

}  // namespace
}  // namespace plumb
