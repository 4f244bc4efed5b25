// SPDX-License-Identifier: Apache-2.0
// The commands around sensors and prints, through the real binary: record, .oni files, markers,
// doctor.
#include <fstream>
#include <map>

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "daemon/cli/unit/burn_in.hpp"
#include "tests/integration/command_line.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class DevicesTest : public CommandLineTest {
 protected:
  void SetUp() override {
    CommandLineTest::SetUp();
    ::setenv("XDG_CACHE_HOME", PLUMB_INTEGRATION_DATA "/cache",
             1);  // of what the virtual sensor shows
  }
};

TEST_F(DevicesTest, MarkersAreDrawnAsPdfAndSvg) {
  const RunResult pdf = Plumb({"markers", "--ids", "0-3", "--out", (folder_ / "m.pdf").string()});
  EXPECT_EQ(pdf.exit_code, 0) << pdf.err;
  EXPECT_THAT(pdf.out, HasSubstr("2 pages"));
  const RunResult svg =
      Plumb({"markers", "--ids", "0-3", "--paper", "A3", "--out", (folder_ / "m.svg").string()});
  EXPECT_EQ(svg.exit_code, 0) << svg.err;
  EXPECT_THAT(ReadText(folder_ / "m.svg"), HasSubstr("width=\"297mm\""));
  EXPECT_THAT(LeftBehind({"m.pdf", "m.svg"}), IsEmpty());
}

TEST_F(DevicesTest, MarkersThatDoNotFitAreUsageErrors) {
  EXPECT_EQ(Plumb({"markers", "--length", "1", "--out", (folder_ / "m.pdf").string()}).exit_code,
            2);
  EXPECT_EQ(Plumb({"markers", "--ids", "900", "--out", (folder_ / "m.pdf").string()}).exit_code, 2);
  EXPECT_EQ(Plumb({"markers", "--out", (folder_ / "m.docx").string()}).exit_code, 2);
  EXPECT_EQ(Plumb({"markers", "--out", (folder_ / "missing" / "m.pdf").string()}).exit_code, 1);
  EXPECT_THAT(LeftBehind({}), IsEmpty());
}

TEST_F(DevicesTest, DoctorSaysWhatIsMissingAndWhatToDo) {
  const RunResult doctor = Plumb({"doctor", "--json"});
  const json report = json::parse(doctor.out);
  EXPECT_EQ(doctor.exit_code == 0, report.at("ready").get<bool>()) << doctor.err;
  bool sensor_told = false, has_sensor = false;
  for (const json& finding : report.at("findings")) {
    if (finding.at("state") == "bad" || finding.at("state") == "note") {
      EXPECT_FALSE(finding.at("found").get<std::string>().empty());
    }
    has_sensor = has_sensor || (finding.at("what") == "sensor" && finding.at("state") == "ok");
    sensor_told = sensor_told || finding.at("what") == "sensor" || finding.at("what") == "OpenNI2";
  }
  EXPECT_TRUE(sensor_told);
  if (!has_sensor) {
    EXPECT_EQ(doctor.exit_code, 5) << "as on any machine that tests";
  }
}

TEST_F(DevicesTest, DoctorNamesADamagedConfiguration) {
  WriteText(folder_ / "plumb.toml", "[compare]\nposture = 7\n");
  const RunResult doctor = Plumb({"doctor", "--config", (folder_ / "plumb.toml").string()});
  EXPECT_EQ(doctor.exit_code, 3);
  EXPECT_THAT(doctor.out, HasSubstr("plumb.toml"));
  EXPECT_THAT(doctor.out, HasSubstr("BAD"));
}

#ifdef PLUMB_WITH_OPENNI

TEST_F(DevicesTest, WithoutASensorRecordIsADeviceError) {
  const RunResult record =
      Plumb({"record", "--serial", "NOBODY", "--out", (folder_ / "r").string()});
  EXPECT_EQ(record.exit_code, 5);
  EXPECT_THAT(record.err, HasSubstr("attached"));
  EXPECT_THAT(LeftBehind({}), IsEmpty());
}

TEST_F(DevicesTest, ASimulatedSuiteOfOniFilesIsReconstructedAndDescribed) {
  const fs::path suite = folder_ / "suite";
  const RunResult simulate =
      Plumb({"simulate", "--suite", "demo", "--out", suite.string(), "--frames", "12", "--rate",
             "10", "--size", "320x240", "--noise", "ideal", "--format", "oni"});
  ASSERT_EQ(simulate.exit_code, 0) << simulate.err;
  const std::string file = (suite / "recordings" / "reference.oni").string();
  const json facts = json::parse(Plumb({"info", file, "--json"}).out);
  EXPECT_EQ(facts.at("frames"), 12);
  EXPECT_NEAR(facts.at("rate_hz").get<double>(), 10.0, 0.1);
  EXPECT_EQ(facts.at("warnings"), json::array());
  const RunResult reconstruct =
      Plumb({"reconstruct", file, "--out", (folder_ / "scene").string(), "--json"});
  ASSERT_EQ(reconstruct.exit_code, 0) << reconstruct.err;
  const json frames = json::parse(reconstruct.out).at("frames");
  EXPECT_EQ(frames.at("total"), 12);
  EXPECT_GE(frames.at("tracked"), 8);
  // Stamps are those of the simulator, so that truth and trajectory meet.
  EXPECT_THAT(ReadText(folder_ / "scene" / "trajectory_all.txt"), HasSubstr("\n17000000"));
}

TEST_F(DevicesTest, ADamagedOniFileIsBadInput) {
  WriteText(folder_ / "bad.oni",
            "NI10 and nothing that follows makes sense, for a good number of bytes at least");
  const RunResult reconstruct =
      Plumb({"reconstruct", (folder_ / "bad.oni").string(), "--out", (folder_ / "scene").string()});
  EXPECT_EQ(reconstruct.exit_code, 3);
  EXPECT_THAT(reconstruct.err, HasSubstr("bad.oni"));
  EXPECT_THAT(LeftBehind({"bad.oni"}), IsEmpty());
}

TEST_F(DevicesTest, RecordsAVirtualSensorToAFolderAndToAnOniFile) {
  // Other markers than the virtual sensor's: its own file is the source for them.
  WriteText(folder_ / "room.toml", "[markers]\nlength_m = 0.083\nreference = 11\n");
  for (const char* name : {"r", "r.oni"}) {
    const RunResult record =
        Plumb({"record", "--simulated", "demo", "--seconds", "0.5", "--config",
               (folder_ / "room.toml").string(), "--out", (folder_ / name).string()});
    ASSERT_EQ(record.exit_code, 0) << record.err;
    EXPECT_THAT(record.out, HasSubstr("VIRTUAL-0001"));
    const json facts = json::parse(Plumb({"info", (folder_ / name).string(), "--json"}).out);
    EXPECT_GE(facts.at("frames"), 8);  // 15 on a machine that keeps up
    EXPECT_LE(facts.at("frames"), 25);
    EXPECT_NE(facts.at("calibration"), "assumed");
  }
  EXPECT_THAT(ReadText(folder_ / "r" / "camera.yaml"), HasSubstr("marker_length: 0.104"));
  EXPECT_THAT(LeftBehind({"r", "r.oni", "r.oni.yaml", "room.toml"}), IsEmpty());
}

#endif

TEST_F(DevicesTest, ABurnInWorksTheMachineAndSaysWhatItFound) {
  const RunResult doctor = Plumb({"--control", (folder_ / "none").string(), "doctor", "--json",
                                  "--burn-in", "0.01", "--burn-in-folder", folder_.string()});
  const json findings = json::parse(doctor.out).at("findings");
  std::map<std::string, json> of;
  for (const json& finding : findings) of[finding.at("what")] = finding;  // the last of each
  for (const char* what : {"processor", "memory", "disk"})
    EXPECT_EQ(of[what].value("state", "missing"), "ok") << of[what];
  EXPECT_THAT(of["processor"].value("found", ""), HasSubstr("2 rounds"));
  EXPECT_THAT(of["sensor"].value("found", ""), HasSubstr("not part of this burn-in"));
  EXPECT_THAT(LeftBehind({}), IsEmpty());
}

TEST_F(DevicesTest, ABurnInWithoutADiskToWriteToIsAFault) {
  const RunResult doctor = Plumb(
      {"doctor", "--json", "--burn-in", "0.01", "--burn-in-folder", (folder_ / "none").string()});
  EXPECT_NE(doctor.exit_code, 0);
  EXPECT_THAT(doctor.out, HasSubstr("cannot write"));
  EXPECT_EQ(Plumb({"doctor", "--burn-in", "0"}).exit_code, 2);
}

TEST(BurnInTest, AResultThatDiffersIsFound) {
  EXPECT_TRUE(FirstDifference("same", "same").empty());
  EXPECT_THAT(FirstDifference("same", "samy").English(), HasSubstr("byte 3"));
  EXPECT_THAT(FirstDifference("same", "sam").English(), HasSubstr("3 bytes instead of 4"));
}

TEST(BurnInTest, AFlippedBitInMemoryIsFound) {
  constexpr std::size_t kBytes = 1 << 16;
  EXPECT_TRUE(TestMemory(kBytes, 1).empty());
  for (const int bit : {0, 63}) {
    EXPECT_THAT(TestMemory(kBytes, 1,
                           [bit](std::uint64_t* words, std::size_t count) {
                             words[count - 1] ^= std::uint64_t{1} << bit;
                           })
                    .English(),
                HasSubstr("wrote"));
  }
}

TEST(BurnInTest, AByteThatTheDiskChangesOrLosesIsFound) {
  const testing::TempFolder folder;
  constexpr std::size_t kBytes = 1 << 16;
  EXPECT_TRUE(TestDisk(folder.path(), kBytes, 1).empty());
  EXPECT_THAT(TestDisk(folder.path(), kBytes, 1,
                       [](const std::filesystem::path& file) {
                         std::fstream out(file, std::ios::in | std::ios::out | std::ios::binary);
                         out.seekp(kBytes - 1);
                         out.put('\0').put('\1');
                       })
                  .English(),
              ::testing::Not(IsEmpty()));
  EXPECT_THAT(TestDisk(folder.path(), kBytes, 1,
                       [](const std::filesystem::path& file) {
                         std::filesystem::resize_file(file, kBytes - 1);
                       })
                  .English(),
              HasSubstr("does not hold what was written"));
  EXPECT_THAT(TestDisk(folder / "none", kBytes, 1).English(), HasSubstr("cannot write"));
}

}  // namespace
}  // namespace plumb
