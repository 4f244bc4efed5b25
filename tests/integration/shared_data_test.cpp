// The recordings beside the project, where they are there: another simulator's sweeps with truth, and a real sensor's.
#include <cmath>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "daemon/files/scene_folder.hpp"
#include "tests/integration/command_line.hpp"

namespace plumb {
namespace {

using nlohmann::json;

class SharedDataTest : public CommandLineTest {};

TEST_F(SharedDataTest, AnotherSimulatorsSweepsWithTruth) {
  const fs::path suite = SharedData("sim-a");
  if (suite.empty()) GTEST_SKIP() << "no recordings at ../shared/data/sim-a";
  const RunResult result = Plumb({"evaluate", suite, "--out", folder_ / "out", "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json figures = json::parse(result.out);
  for (const auto& pair : figures.at("pairs")) {
    // The bar for every pair of another simulator: 3 mm and 0.3 deg in the median, 6 mm at most.
    EXPECT_LE(pair.at("translation_mm").get<double>(), 6.0);
    EXPECT_LE(pair.at("rotation_deg").get<double>(), 0.6);
  }
  for (const auto& [name, scene] : figures.at("scenes").items()) {
    EXPECT_EQ(scene.at("frames").at("tracked"), scene.at("frames").at("total")) << name;
    EXPECT_LE(scene.at("trajectory_all").at("ate_rmse_mm").get<double>(), 8.0) << name;
  }
}

TEST_F(SharedDataTest, ARealSensorTracksWithTagsAndWithout) {
  const fs::path recording = SharedData("real-tags");
  if (recording.empty()) GTEST_SKIP() << "no recording at ../shared/data/real-tags";
  WriteText(folder_ / "keypoints.toml", "[reconstruct]\nuse_markers = false\n");
  const RunResult with = Plumb({"reconstruct", recording, "--out", folder_ / "with", "--json"});
  const RunResult without =
      Plumb({"reconstruct", recording, "--out", folder_ / "without", "--json", "--config", folder_ / "keypoints.toml"});
  for (const RunResult& result : {with, without}) {
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const json frames = json::parse(result.out).at("frames");
    EXPECT_EQ(frames.at("tracked"), frames.at("total"));
  }
}

}  // namespace
}  // namespace plumb
