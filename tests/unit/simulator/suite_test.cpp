// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/suites/suite.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>

#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/pose.hpp"
#include "algo/base/units.hpp"
#include "algo/types/marker.hpp"
#include "drivers/simulator/suites/suite_plan.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

class SuiteTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / ("plumb-suite-" + std::to_string(::getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  SimulateOptions Small(const std::string& name) const {
    return {.suite = "demo",
            .out = folder_ / name,
            .seed = 5,
            .noise = simulated::NoiseLevel::kNominal,
            .frames = 3,
            .rate_hz = 0.3,
            .width = 160,
            .height = 120};
  }

  fs::path folder_;
};

std::string Text(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

Pose ToPose(const json& rows) {
  Pose T = Pose::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column)
      T.matrix()(row, column) =
          rows.at(static_cast<std::size_t>(row)).at(static_cast<std::size_t>(column)).get<double>();
  }
  return T;
}

Eigen::Vector3d ToPoint(const json& values) {
  return {values.at(0).get<double>(), values.at(1).get<double>(), values.at(2).get<double>()};
}

std::vector<Eigen::Vector3f> PlyVertices(const fs::path& path, std::vector<float>* seen) {
  const std::string bytes = Text(path);
  const std::size_t count = std::stoul(bytes.substr(bytes.find("element vertex ") + 15));
  const char* data = bytes.data() + bytes.find("end_header\n") + 11;
  std::vector<Eigen::Vector3f> vertices;
  for (std::size_t i = 0; i < count; ++i) {
    std::array<float, 4> values{};
    std::memcpy(values.data(), data + 16 * i, 16);
    vertices.emplace_back(values[0], values[1], values[2]);
    seen->push_back(values[3]);
  }
  return vertices;
}

TEST_F(SuiteTest, WritesRecordingsAndATruthThatAgreesWithItself) {
  SimulateSuite(Small("demo"));
  const fs::path out = folder_ / "demo";
  const json suite = json::parse(Text(out / "suite.json"));
  EXPECT_EQ(suite.at("name"), "demo");
  EXPECT_EQ(suite.at("scenes"), json({"reference", "moved"}));
  EXPECT_EQ(suite.at("pairs"), json::array({{"reference", "moved"}}));
  EXPECT_EQ(suite.at("simulated").at("unit"), 5);
  EXPECT_EQ(suite.at("simulated").at("faults"),
            simulated::MildFaults(simulated::NoiseLevel::kNominal).Names());
  for (const char* name : {"reference", "moved"}) {
    for (const char* file : {"rgb.txt", "depth.txt", "camera.yaml"})
      EXPECT_TRUE(fs::exists(out / "recordings" / name / file)) << name << file;
    EXPECT_EQ(std::distance(fs::directory_iterator(out / "recordings" / name / "rgb"), {}), 3);
    EXPECT_EQ(std::distance(fs::directory_iterator(out / "recordings" / name / "depth"), {}), 3);
  }

  // The motion maps the reference body's surface onto the moved one's, in the world and in the
  // marker's frame.
  const json motion = json::parse(Text(out / "truth/moved/motion.json"));
  std::vector<float> seen;
  const auto before = PlyVertices(out / "truth/reference/body.ply", &seen);
  const auto after = PlyVertices(out / "truth/moved/body.ply", &seen);
  ASSERT_EQ(before.size(), after.size());
  const Pose M = ToPose(motion.at("motion_world"));
  const Pose T_world_marker = ToPose(motion.at("T_world_reference_marker"));
  const Pose M_marker = ToPose(motion.at("motion_reference_marker"));
  EXPECT_GT(RotationAngle(M), 2 * kDegree);
  for (std::size_t i = 0; i < before.size(); i += 97) {
    const Eigen::Vector3d moved = M * before[i].cast<double>();
    EXPECT_LT((moved - after[i].cast<double>()).norm(), 1e-6);  // Floats in the file.
    EXPECT_LT(
        (T_world_marker * M_marker * T_world_marker.inverse() * before[i].cast<double>() - moved)
            .norm(),
        1e-9);
  }
  EXPECT_TRUE(M.isApprox(
      ToPose(motion.at("T_world_body")) * ToPose(motion.at("T_world_body0")).inverse(), 1e-9));
  EXPECT_LT((ToPoint(motion.at("centroid_world")) -
             ToPose(motion.at("T_world_body")) * ToPoint(motion.at("centroid_body")))
                .norm(),
            1e-9);
  EXPECT_GT(*std::max_element(seen.begin(), seen.end()), 0.0F);
  EXPECT_LE(*std::max_element(seen.begin(), seen.end()), 3.0F);

  // Corners in the paper's order, and the reference marker among them.
  const json markers = json::parse(Text(out / "truth/moved/markers.json"));
  EXPECT_GE(markers.at("markers").size(), 10U);
  const double h = 0.052;
  const std::array<Eigen::Vector3d, 4> paper = {Eigen::Vector3d(-h, -h, 0),
                                                Eigen::Vector3d(h, -h, 0), Eigen::Vector3d(h, h, 0),
                                                Eigen::Vector3d(-h, h, 0)};
  bool found = false;
  for (const auto& [id, marker] : markers.at("markers").items()) {
    const Pose T = ToPose(marker.at("T_world_marker"));
    for (std::size_t i = 0; i < 4; ++i)
      EXPECT_LT((T * paper[i] - ToPoint(marker.at("corners").at(i))).norm(), 1e-9) << id;
    EXPECT_GT(T.linear()(2, 2), 0.98) << "boards lie almost flat";
    if (T.isApprox(T_world_marker, 1e-9)) {
      found = true;
      EXPECT_THAT(Text(out / "recordings/moved/camera.yaml"),
                  testing::HasSubstr("reference_marker: " + id + "\n"));
    }
  }
  EXPECT_TRUE(found);

  // 500 poses a second, looking down at the support.
  std::istringstream trajectory(Text(out / "truth/moved/groundtruth.txt"));
  std::string line;
  std::getline(trajectory, line);
  int poses = 0;
  double last = 0;
  for (double t = 0, x, y, z, qx, qy, qz, qw;
       trajectory >> t >> x >> y >> z >> qx >> qy >> qz >> qw; ++poses) {
    if (poses > 0) {
      EXPECT_NEAR(t - last, 0.002, 1e-6);
    }
    last = t;
    EXPECT_GT(z, 0.7);
    EXPECT_LT((Eigen::Quaterniond(qw, qx, qy, qz) * Eigen::Vector3d::UnitZ()).z(), -0.8);
  }
  EXPECT_GT(poses, 5000);
}

TEST_F(SuiteTest, TheSameSeedGivesTheSameBytes) {
  SimulateSuite(Small("a"));
  SimulateSuite(Small("b"));
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder_ / "a")) {
    if (!entry.is_regular_file()) continue;
    EXPECT_EQ(Text(entry.path()), Text(folder_ / "b" / fs::relative(entry.path(), folder_ / "a")))
        << entry.path();
  }
}

TEST_F(SuiteTest, AStopLeavesNothingBehind) {
  std::stop_source stop;
  EXPECT_THROW(SimulateSuite(Small("demo"), stop.get_token(),
                             [&](double, std::string_view) { stop.request_stop(); }),
               Interrupted);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(SuiteTest, RefusesAFolderThatIsInUse) {
  fs::create_directories(folder_ / "demo");
  std::ofstream(folder_ / "demo" / "notes.txt") << "keep me";
  EXPECT_THROW(SimulateSuite(Small("demo")), DataError);
  EXPECT_EQ(Text(folder_ / "demo" / "notes.txt"), "keep me");
}

TEST_F(SuiteTest, RefusesWhatItDoesNotKnow) {
  SimulateOptions options = Small("demo");
  options.suite = "ten";
  EXPECT_THROW(SimulateSuite(options), std::invalid_argument);
  options = Small("demo");
  options.frames = 0;
  EXPECT_THROW(SimulateSuite(options), std::invalid_argument);
  options = Small("demo");
  options.width = 7;
  EXPECT_THROW(SimulateSuite(options), std::invalid_argument);
  EXPECT_TRUE(fs::is_empty(folder_));
  EXPECT_FALSE(Named<simulated::NoiseLevel>("loud"));
}

TEST(SuitePlanTest, NineHasSeventyTwoPairsAndMarkersThatEverySweepSees) {
  const simulated::SuitePlan plan = simulated::PlanSuite({.suite = "nine", .out = {}, .seed = 2});
  EXPECT_EQ(plan.scenes.size(), 9U);
  EXPECT_EQ(plan.pairs.size(), 72U);
  ASSERT_GE(plan.room.boards.size(), 10U);
  for (const auto& scene : plan.scenes) {
    const simulated::Trajectory trajectory(scene.sweep.motion);
    int seen = 0;
    int reference_seen = 0;
    constexpr int kFrames = 50;
    for (int i = 0; i < kFrames; ++i) {
      const Pose T_camera_world = trajectory.T_world_camera(10.0 * (i + 0.5) / kFrames).inverse();
      for (const simulated::Board& board : plan.room.boards) {
        bool inside = true;
        for (const Eigen::Vector3d& corner : CornersInMarkerFrame(simulated::kMarkerLength)) {
          const Eigen::Vector2d pixel =
              Project(plan.unit.color_true, T_camera_world * (board.T_world_marker * corner));
          inside = inside && pixel.x() > 4 && pixel.y() > 4 && pixel.x() < 635 && pixel.y() < 475;
        }
        seen += inside ? 1 : 0;
        reference_seen += inside && board.id == plan.reference_marker ? 1 : 0;
      }
    }
    EXPECT_GE(seen, 3 * kFrames) << scene.name;
    EXPECT_GE(reference_seen, 4) << scene.name;
    // The body lies on the support: it neither floats nor sinks.
    double lowest = 1.0;
    for (const Eigen::Vector3f& vertex : scene.body->surface.vertices)
      lowest = std::min(lowest, (scene.T_world_body * vertex.cast<double>()).z());
    EXPECT_NEAR(lowest, -0.001, 1e-5);
  }
}

TEST(SuitePlanTest, SmallMovesAreSmallAndSomeAreInToleranceByHalf) {
  const simulated::SuitePlan plan = simulated::PlanSuite({.suite = "small", .out = {}, .seed = 3});
  EXPECT_EQ(plan.scenes.size(), 10U);
  EXPECT_EQ(plan.pairs.size(), 90U);
  int close = 0, far = 0;
  for (const simulated::ScenePlan& a : plan.scenes) {
    for (const simulated::ScenePlan& b : plan.scenes) {
      if (&a == &b) continue;
      const Pose M = b.T_world_body * a.T_world_body.inverse();
      const Eigen::Vector3d shift =
          b.T_world_body * b.body->centroid - a.T_world_body * a.body->centroid;
      EXPECT_LT(shift.norm(), 12 * kMillimetre);
      EXPECT_LT(RotationAngle(M), 3 * kDegree);
      close += shift.cwiseAbs().maxCoeff() < 1.5 * kMillimetre && RotationAngle(M) < 0.5 * kDegree;
      far += shift.cwiseAbs().maxCoeff() > 3 * kMillimetre || RotationAngle(M) > 1 * kDegree;
    }
  }
  EXPECT_GE(close, 10);
  EXPECT_GE(far, 40);
}

TEST(SuitePlanTest, TheUnitChangesTheSensorAndNothingElse) {
  const simulated::SuitePlan a = simulated::PlanSuite({.suite = "nine", .out = {}, .seed = 2});
  const simulated::SuitePlan b =
      simulated::PlanSuite({.suite = "nine", .out = {}, .seed = 2, .unit = 7});
  EXPECT_EQ(a.unit.seed, 2U);
  EXPECT_EQ(b.unit.seed, 7U);
  EXPECT_NE(a.unit.color_true, b.unit.color_true);
  EXPECT_EQ(a.unit.faults, simulated::FaultsOf(simulated::NoiseLevel::kNominal));
  ASSERT_EQ(a.room.boards.size(), b.room.boards.size());
  for (std::size_t i = 0; i < a.room.boards.size(); ++i) {
    EXPECT_EQ(a.room.boards[i].id, b.room.boards[i].id);
    EXPECT_TRUE(a.room.boards[i].T_world_marker.isApprox(b.room.boards[i].T_world_marker, 0.0));
  }
  const simulated::Trajectory one(a.scenes[4].sweep.motion), other(b.scenes[4].sweep.motion);
  EXPECT_TRUE(one.T_world_camera(3.3).isApprox(other.T_world_camera(3.3), 0.0));
}

TEST(SuitePlanTest, OnlyADemoOfNoUnitIsMild) {
  using simulated::NoiseLevel;
  EXPECT_EQ(FaultsOf({.suite = "demo", .out = {}}), simulated::MildFaults(NoiseLevel::kNominal));
  EXPECT_EQ(FaultsOf({.suite = "demo", .out = {}, .unit = 1}),
            simulated::FaultsOf(NoiseLevel::kNominal));
  EXPECT_EQ(FaultsOf({.suite = "nine", .out = {}}), simulated::FaultsOf(NoiseLevel::kNominal));
  EXPECT_EQ(FaultsOf({.suite = "nine", .out = {}, .noise = NoiseLevel::kIdeal}),
            simulated::FaultSet());
  EXPECT_EQ(FaultsOf({.suite = "nine", .out = {}, .faults = simulated::FaultSet()}),
            simulated::FaultSet());
}

}  // namespace
}  // namespace plumb
