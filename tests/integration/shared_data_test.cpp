// SPDX-License-Identifier: Apache-2.0
// The recordings beside the project, where they are there: another simulator's sweeps with truth,
// and those of two real sensors. Bounds are 20 % above the figures that the README states, but
// never above what is required: motion 1.5 mm and 0.15 deg on `sim-b` alone, 1.0 mm and 0.1 deg
// with a profile, 1.2 mm on `sim-a`, a marker map within 2 permille.

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "daemon/evaluation/accuracy.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/files/trajectory_file.hpp"
#include "tests/integration/command_line.hpp"

namespace plumb {
namespace {

using nlohmann::json;

class SharedDataTest : public CommandLineTest {
 protected:
  struct Errors {
    std::vector<double> translation_mm;
    std::vector<double> rotation_deg;
    int inside = 0;                  // How many of the six of each pair lie in their 95 % interval.
    std::vector<double> normalised;  // Of the six of each pair: error by standard deviation.
    std::vector<double> ate_mm;      // Of every scene, over all frames.
    std::vector<double> scale_permille;  // Of every scene's marker map, without its sign.
    /// Bounds that intervals of half or of double the width fail: of 36 numbers 34 are expected,
    /// and a root mean square of 1.
    void ExpectThatIntervalsHold() const {
      ASSERT_EQ(normalised.size(), 6 * translation_mm.size());
      EXPECT_GE(inside, 0.85 * static_cast<double>(normalised.size()));
      const double rms = std::sqrt(
          std::inner_product(normalised.begin(), normalised.end(), normalised.begin(), 0.0) /
          static_cast<double>(normalised.size()));
      // Measured: 0.78 on sim-a, 0.59 on sim-b and 0.62 there with a profile.
      EXPECT_GE(rms, 0.5);
      EXPECT_LE(rms, 1.0);
    }
  };
  // One spacing of keyframes gives one number, and a part of it is luck: three give the errors of
  // every pair three times. They take minutes, so a short run has the usual spacing alone.
  static std::vector<std::string> Spacings() {
    if (std::getenv("PLUMB_ALL_SPACINGS") != nullptr) return {"0.75", "1.0", "1.3"};
    return {"1.0"};
  }
  static std::size_t NumErrors(std::size_t num_pairs) { return num_pairs * Spacings().size(); }
  Errors ErrorsOf(const fs::path& suite, const std::string& out,
                  const std::vector<std::string>& more = {}) {
    Errors errors;
    for (const std::string& spacing : Spacings()) {
      const fs::path config = folder_ / (out + spacing + ".toml");
      WriteText(config, "[reconstruct]\nkeyframe_spacing = " + spacing + "\n");
      std::vector<std::string> arguments = {
          "evaluate", suite, "--out", folder_ / (out + spacing), "--json", "--config", config};
      arguments.insert(arguments.end(), more.begin(), more.end());
      const RunResult result = Plumb(arguments);
      EXPECT_EQ(result.exit_code, 0) << result.err;
      const json figures = json::parse(result.out);
      for (const auto& [name, scene] : figures.at("scenes").items()) {
        EXPECT_EQ(scene.at("frames").at("tracked"), scene.at("frames").at("total")) << name;
        errors.ate_mm.push_back(scene.at("trajectory_all").at("ate_rmse_mm"));
        errors.scale_permille.push_back(std::abs(scene.at("marker_scale_permille").get<double>()));
      }
      for (const auto& pair : figures.at("pairs")) {
        if (!pair.contains("translation_mm") || pair.at("translation_mm").is_null()) continue;
        errors.translation_mm.push_back(pair.at("translation_mm").get<double>());
        errors.rotation_deg.push_back(pair.at("rotation_deg").get<double>());
        for (const auto& [name, number] : pair.at("numbers").items()) {
          if (number.is_null()) continue;
          errors.inside += number.at("inside").get<bool>() ? 1 : 0;
          errors.normalised.push_back(
              1.96 * (number.at("value").get<double>() - number.at("truth").get<double>()) /
              number.at("u95").get<double>());
        }
      }
    }
    return errors;
  }
};

double Mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}
double Largest(const std::vector<double>& values) {
  return *std::max_element(values.begin(), values.end());
}

TEST_F(SharedDataTest, AnotherSimulatorsSweepsWithTruth) {
  PLUMB_SHARED_DATA(suite, "sim-a");
  const Errors errors = ErrorsOf(suite, "out");
  ASSERT_EQ(errors.translation_mm.size(), NumErrors(2));
  EXPECT_LE(Mean(errors.translation_mm), 1.2);      // Measured: 1.19.
  EXPECT_LE(Largest(errors.translation_mm), 1.58);  // Measured: 1.46.
  EXPECT_LE(Mean(errors.rotation_deg), 0.069);      // Measured: 0.057; 0.068 at 1.0.
  EXPECT_LE(Largest(errors.rotation_deg), 0.083);   // Measured: 0.077.
  EXPECT_LE(Largest(errors.ate_mm), 2.1);           // Measured: 1.77.
  EXPECT_LE(Largest(errors.scale_permille), 0.58);  // Measured: 0.49.
  errors.ExpectThatIntervalsHold();
}

TEST_F(SharedDataTest, AUnitWithABentDepthImageAndAToneCurveOfItsOwn) {
  PLUMB_SHARED_DATA(suite, "sim-b");
  const fs::path profile = folder_ / "unit.json";
  const RunResult learned = Plumb({"calibrate", suite / "other_room", "--out", profile});
  ASSERT_EQ(learned.exit_code, 0) << learned.err;
  const Errors alone = ErrorsOf(suite, "alone");
  const Errors with_profile = ErrorsOf(suite, "with", {"--sensor-profile", profile});
  // The other room shows another body.
  ASSERT_EQ(alone.translation_mm.size(), NumErrors(2));
  ASSERT_EQ(with_profile.translation_mm.size(), NumErrors(2));
  EXPECT_LE(Mean(alone.translation_mm), 0.66);           // Measured: 0.55.
  EXPECT_LE(Largest(alone.translation_mm), 1.04);        // Measured: 0.96.
  EXPECT_LE(Mean(alone.rotation_deg), 0.09);             // Measured: 0.070; 0.082 at 1.0.
  EXPECT_LE(Largest(alone.rotation_deg), 0.113);         // Measured: 0.094.
  EXPECT_LE(Mean(with_profile.translation_mm), 0.79);    // Measured: 0.66.
  EXPECT_LE(Largest(with_profile.translation_mm), 1.0);  // Measured: 0.93.
  EXPECT_LE(Mean(with_profile.rotation_deg), 0.095);     // Measured: 0.074; 0.087 at 1.0.
  EXPECT_LE(Largest(with_profile.rotation_deg), 0.119);  // Measured: 0.099.
  // All three sweeps at three spacings.
  EXPECT_LE(Mean(alone.ate_mm), 2.0);                     // Measured: 1.75.
  EXPECT_LE(Largest(alone.ate_mm), 3.2);                  // Measured: 2.68.
  EXPECT_LE(Largest(with_profile.ate_mm), 3.2);           // Measured: 2.70.
  EXPECT_LE(Largest(alone.scale_permille), 0.89);         // Measured: 0.74.
  EXPECT_LE(Largest(with_profile.scale_permille), 0.80);  // Measured: 0.67.
  alone.ExpectThatIntervalsHold();
  with_profile.ExpectThatIntervalsHold();
}

TEST_F(SharedDataTest, ARecordingOfRealSenseViewerIsRecognised) {
  PLUMB_SHARED_DATA(folder, "real-d435");
  const RunResult result =
      Plumb({"info", folder / "bag" / "single_depth_color_640x480.bag", "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json facts = json::parse(result.out);
  EXPECT_EQ(facts.at("sensor").at("serial"), "728612070259");
  EXPECT_EQ(facts.at("sensor").at("firmware"), "05.09.14.00");
  EXPECT_EQ(facts.at("depth_sensor"), "active_stereo");
  EXPECT_NEAR(facts.at("focal_px").at(0).get<double>(), 613.20, 0.005);
  const json& depth = facts.at("depth");
  EXPECT_NEAR(depth.at("focal_px").at(0).get<double>(), 390.43, 0.005);
  EXPECT_NEAR(depth.at("unit_mm").get<double>(), 1.0, 1e-6);
  EXPECT_NEAR(depth.at("colour_from_depth_mm").at(0).get<double>(), 14.3, 0.05);
  EXPECT_NEAR(depth.at("stereo_baseline_mm").get<double>(), 50.17, 0.005);
}

// Depth of a RealSense is not registered to colour unless somebody asks for it, and its cameras are
// not the assumed ones: the path would be 15 % too short.
TEST_F(SharedDataTest, AFolderWithoutCamerasIsRefusedWhereTheAssumedOnesDoNotFit) {
  PLUMB_SHARED_DATA(lab, "real-d435/lab");
  PLUMB_SHARED_DATA(kinect, "real-kinect");
  fs::remove(Copy(kinect, "kinect") / "camera.yaml");
  for (const fs::path& recording : {lab, folder_ / "kinect"}) {
    const RunResult result = Plumb({"reconstruct", recording, "--out", folder_ / "scene"});
    EXPECT_EQ(result.exit_code, 3) << recording;
    EXPECT_THAT(result.err, testing::HasSubstr("nothing states the sensor's cameras"));
    EXPECT_THAT(result.err, testing::HasSubstr("depth is not registered to colour; write "
                                               "camera.yaml with image_width"));
    EXPECT_FALSE(fs::exists(folder_ / "scene"));
  }
}

TEST_F(SharedDataTest, AFolderWithoutCamerasIsReadWhereTheAssumedOnesFit) {
  PLUMB_SHARED_DATA(a, "sim-a");
  PLUMB_SHARED_DATA(b, "sim-b");
  for (const fs::path& suite : {a, b}) {
    const fs::path recording = Copy(suite / "reference", suite.filename());
    fs::remove(recording / "camera.yaml");
    const fs::path scene = folder_ / (suite.filename().string() + ".scene");
    const RunResult result = Plumb({"reconstruct", recording, "--out", scene, "--json"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_TRUE(json::parse(result.out).value("refusals", json::array()).empty()) << result.out;
    const fs::path truth_file = suite / "truth" / "reference" / "groundtruth.txt";
    SceneTruth truth;
    truth.trajectory = ParseTrajectory(ReadText(truth_file), truth_file);
    const SceneParts none{.cloud = false, .height_map = false, .mesh = false};
    const auto error = ErrorOfTrajectory(ReadScene(scene, none).trajectory, truth);
    ASSERT_TRUE(error);
    EXPECT_LE(error->rmse_mm, 2.0);  // Measured: 1.2 and 1.5, on paths of 1.4 m.
  }
}

TEST_F(SharedDataTest, ARealSensorTracksWithTagsAndWithout) {
  PLUMB_SHARED_DATA(recording, "real-tags");
  WriteText(folder_ / "keypoints.toml", "[reconstruct]\nuse_markers = false\n");
  const RunResult with = Plumb({"reconstruct", recording, "--out", folder_ / "with", "--json"});
  const RunResult without = Plumb({"reconstruct", recording, "--out", folder_ / "without", "--json",
                                   "--config", folder_ / "keypoints.toml"});
  for (const RunResult& result : {with, without}) {
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const json frames = json::parse(result.out).at("frames");
    EXPECT_EQ(frames.at("tracked"), frames.at("total"));
  }
  const SceneParts none{.cloud = false, .height_map = false, .mesh = false};
  const std::vector<StampedPose> a = ReadScene(folder_ / "with", none).trajectory,
                                 b = ReadScene(folder_ / "without", none).trajectory;
  ASSERT_EQ(a.size(), b.size());
  SceneTruth path;  // one path measured against the other as if that were true
  path.trajectory = a;
  const auto error = ErrorOfTrajectory(b, path);
  ASSERT_TRUE(error);
  EXPECT_LE(error->rmse_mm, 0.6);  // Measured: 0.5.
  for (const std::vector<StampedPose>& poses : {a, b}) {
    for (std::size_t i = 1; i + 1 < poses.size(); ++i) {
      const Eigen::Vector3d bend = poses[i - 1].T_world_camera.translation() -
                                   2 * poses[i].T_world_camera.translation() +
                                   poses[i + 1].T_world_camera.translation();
      // Measured: up to 10.0 mm at frame 47, where both paths agree (the recording skips there),
      // below 6.5 mm elsewhere.
      EXPECT_LE(bend.norm(), 0.012) << "the camera jumps at frame " << i;
    }
  }
}

TEST_F(SharedDataTest, ARealSensorsPathAgreesWithMotionCapture) {
  PLUMB_SHARED_DATA(recording, "real-kinect");
  const RunResult result = Plumb({"reconstruct", recording, "--out", folder_ / "scene", "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json frames = json::parse(result.out).at("frames");
  EXPECT_EQ(frames.at("tracked"), frames.at("total"));
  const SceneParts none{.cloud = false, .height_map = false, .mesh = false};
  const fs::path file = recording / "truth" / "groundtruth.txt";
  SceneTruth truth;
  truth.trajectory = ParseTrajectory(ReadText(file), file);
  const auto error = ErrorOfTrajectory(ReadScene(folder_ / "scene", none).trajectory, truth);
  ASSERT_TRUE(error);
  EXPECT_GE(error->count, 170U) << "of 177 pairs of images";
  EXPECT_LE(error->rmse_mm, 8.5);  // Stated 7.1, measured 7.3.
}

}  // namespace
}  // namespace plumb
