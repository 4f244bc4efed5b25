// SPDX-License-Identifier: Apache-2.0
// What a recording does not state: it stays assumed through `plumb import`, and is found or
// refused.
#include <string>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "drivers/files/image_file.hpp"
#include "tests/integration/command_line.hpp"

namespace plumb {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// Removes the line of a key, or puts another in its place.
void ReplaceLine(const fs::path& file, const std::string& key, const std::string& line) {
  std::string text = ReadText(file);
  const std::size_t at = text.find("\n" + key + ":");
  ASSERT_NE(at, std::string::npos) << key;
  WriteText(file, text.replace(at, text.find('\n', at + 1) - at, line.empty() ? "" : "\n" + line));
}

class ImportTest : public CommandLineTest {
 protected:
  [[nodiscard]] json Info(const fs::path& recording) {
    const RunResult info = Plumb({"info", recording.string(), "--json"});
    EXPECT_EQ(info.exit_code, 0) << info.err;
    return json::parse(info.out);
  }
  /// camera.yaml of the import.
  std::string Imported(const fs::path& source, const fs::path& out,
                       const std::string& config = {}) {
    std::vector<std::string> arguments = {"import", source.string(), "--out", out.string()};
    if (!config.empty()) {
      WriteText(folder_ / "room.toml", config);
      arguments.insert(arguments.end(), {"--config", (folder_ / "room.toml").string()});
    }
    const RunResult import = Plumb(arguments);
    EXPECT_EQ(import.exit_code, 0) << import.err;
    return ReadText(out / "camera.yaml");
  }
};

TEST_F(ImportTest, KeepsWhatIsAssumedAndLeavesTheMarkersToTheConfiguration) {
  const fs::path source = Copy(SmallRecording("reference"), "source");
  fs::remove(source / "camera.yaml");
  EXPECT_THAT(Imported(source, folder_ / "plain"),
              AllOf(HasSubstr("assumed: [ camera_matrix, depth_scale ]"),
                    Not(HasSubstr("marker_length")), Not(HasSubstr("marker_dictionary"))));
  EXPECT_THAT(Imported(source, folder_ / "configured", "[markers]\nlength_m = 0.15\n"),
              AllOf(HasSubstr("marker_length: 0.15\n"), Not(HasSubstr("marker_dictionary"))));
  EXPECT_EQ(Info(folder_ / "plain")["calibration"], "assumed");
  EXPECT_TRUE(Info(folder_ / "plain")["depth"]["unit_assumed"]);
}

TEST_F(ImportTest, WritesWhatIsStatedAsStated) {
  const fs::path source = SmallRecording("reference");
  EXPECT_EQ(Imported(source, folder_ / "again").find("assumed"), std::string::npos);
  const json of_source = Info(source), again = Info(folder_ / "again");
  for (const char* key : {"focal_px", "marker_length_m", "marker_dictionary", "reference_marker"})
    EXPECT_EQ(of_source[key], again[key]) << key;
  EXPECT_EQ(of_source["depth"]["registered"], true);
  EXPECT_EQ(of_source["depth"]["unit_assumed"], false);
}

TEST_F(ImportTest, StampsWithinAMicrosecondAreWritten) {
  const fs::path source = Copy(SmallRecording("reference"), "source");
  for (const char* list : {"rgb.txt", "depth.txt"}) {
    std::string text = ReadText(source / list);
    const std::size_t first = text.find_first_of("0123456789");
    const std::string stamp = text.substr(first, text.find(' ', first) - first);
    const std::size_t second = text.find('\n', first) + 1;
    // The stamps have six decimals; a seventh follows.
    text.replace(second, text.find(' ', second) - second, stamp + "4");
    WriteText(source / list, text);
  }
  const std::string camera = Imported(source, folder_ / "again");
  EXPECT_FALSE(camera.empty());
  EXPECT_EQ(Info(folder_ / "again")["frames"], Info(source)["frames"]);
}

TEST_F(ImportTest, AUnitThatNothingStatesIsTakenFromTheMarkers) {
  const fs::path recording = Copy(SmallRecording("reference"), "recording");
  const double unit_mm = Info(recording)["depth"]["unit_mm"];
  ReplaceLine(recording / "camera.yaml", "depth_scale", "");
  for (const double to_mm : {0.2, 1.0}) {
    for (const auto& entry : fs::directory_iterator(SmallRecording("reference") / "depth")) {
      cv::Mat units = ReadDepthImage(entry.path());
      units.convertTo(units, CV_16U, unit_mm / to_mm);
      WritePng(recording / "depth" / entry.path().filename(), units);
    }
    const json info = Info(recording);
    EXPECT_NEAR(info["depth"]["unit_mm"].get<double>(), to_mm, 1e-9);
    EXPECT_TRUE(info["depth"]["unit_assumed"]);
    EXPECT_THAT(info["warnings"].dump(), HasSubstr("by the size of the markers"));
  }
}

TEST_F(ImportTest, ADepthCameraThatIsNotKnownGivesNoAnswer) {
  const fs::path recording = Copy(SmallRecording("reference"), "recording");
  ReplaceLine(recording / "camera.yaml", "depth_registered", "depth_registered: 0");
  EXPECT_EQ(Info(recording)["depth"]["registered"], false);
  const fs::path scene = folder_ / "scene", result = folder_ / "result";
  const RunResult made = Plumb({"reconstruct", recording.string(), "--out", scene.string()});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const RunResult compared =
      Plumb({"compare", scene.string(), SmallScene(SmallNames().at(1)).string(), "--out",
             result.string(), "--json"});
  EXPECT_EQ(compared.exit_code, 4) << compared.err;
  EXPECT_THAT(compared.out, HasSubstr("nothing states where the depth camera is"));
}

}  // namespace
}  // namespace plumb
