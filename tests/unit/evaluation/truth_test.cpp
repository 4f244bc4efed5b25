// SPDX-License-Identifier: Apache-2.0
#include "daemon/evaluation/truth.hpp"

#include <cstring>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "algo/base/errors.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// A whole truth folder, written by hand in the format of the simulators.
class TruthTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        fs::path(testing::TempDir()) /
        (std::string("truth_") + testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
    Write("groundtruth.txt", "# comment\n1.0 0 0 0 0 0 0 1\n1.01 0.5 0 0 0 0 0 1\n");
    Write(
        "markers.json",
        R"({"length": 0.1, "markers": {"7": {"T_world_marker": [[1,0,0,2],[0,1,0,3],[0,0,1,4],[0,0,0,1]]}}})");
    Write("motion.json", R"({"T_world_body": [[1,0,0,1],[0,1,0,0],[0,0,1,0],[0,0,0,1]],
        "T_world_reference_marker": [[1,0,0,0],[0,1,0,5],[0,0,1,0],[0,0,0,1]], "centroid_body": [0.1, 0.2, 0.3]})");
    Write("body.ply", Ply(1));
  }
  void TearDown() override { fs::remove_all(folder_); }
  void Write(const std::string& name, const std::string& content) {
    std::ofstream(folder_ / name, std::ios::binary) << content;
  }

  static std::string Ply(int last_index) {
    std::string ply =
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float "
        "y\nproperty float z\n"
        "property float seen\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    const float vertices[] = {0, 0, 0, 4, 1, 0, 0, 5, 0, 1, 0.5F, 6};
    ply.append(reinterpret_cast<const char*>(vertices), sizeof(vertices));
    const std::int32_t indices[] = {0, 2, last_index};
    ply += '\x03';
    return ply.append(reinterpret_cast<const char*>(indices), sizeof(indices));
  }
  fs::path folder_;
};

TEST_F(TruthTest, ReadsAllFour) {
  const SceneTruth truth = ReadSceneTruth(folder_);
  ASSERT_EQ(truth.trajectory.size(), 2U);
  EXPECT_EQ(truth.trajectory[1].T_world_camera.translation(), Eigen::Vector3d(0.5, 0, 0));
  // Detector order: the top left corner first, whatever order the file lists corners in.
  EXPECT_NEAR((truth.markers.at(7)[0] - Eigen::Vector3d(1.95, 3.05, 4)).norm(), 0, 1e-12);
  EXPECT_NEAR((truth.centroid_world() - Eigen::Vector3d(1.1, 0.2, 0.3)).norm(), 0, 1e-12);
  EXPECT_EQ(truth.T_world_reference_marker.translation(), Eigen::Vector3d(0, 5, 0));
  EXPECT_EQ(truth.body.frames_seen, (std::vector<float>{4, 5, 6}));
  EXPECT_EQ(truth.body.vertices_world[2], Eigen::Vector3d(0, 1, 0.5));
  EXPECT_EQ(truth.body.triangles[0], (std::array<std::uint32_t, 3>{0, 2, 1}));
}

TEST_F(TruthTest, BreathingIsReadWhereItIsStated) {
  EXPECT_EQ(ReadSceneTruth(folder_).breathing_m, 0.0);
  const std::string poses = R"({"T_world_body": [[1,0,0,1],[0,1,0,0],[0,0,1,0],[0,0,0,1]],
        "T_world_reference_marker": [[1,0,0,0],[0,1,0,5],[0,0,1,0],[0,0,0,1]],
        "centroid_body": [0.1, 0.2, 0.3], "breathing": )";
  Write("motion.json", poses + "null}");
  EXPECT_EQ(ReadSceneTruth(folder_).breathing_m, 0.0);
  Write("motion.json", poses + R"({"amplitude_m": 0.005}})");
  EXPECT_EQ(ReadSceneTruth(folder_).breathing_m, 0.005);
  Write("motion.json", poses + "7}");
  EXPECT_THROW((void)ReadSceneTruth(folder_), DataError);
}

TEST_F(TruthTest, RefusesDamage) {
  const std::string whole = Ply(1);
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{3}, whole.size() - 40, whole.size() - 1}) {
    Write("body.ply", whole.substr(0, size));
    EXPECT_THROW((void)ReadSceneTruth(folder_), DataError) << size;
  }
  Write("body.ply", Ply(3));  // a vertex that does not exist
  EXPECT_THROW((void)ReadSceneTruth(folder_), DataError);
  Write("body.ply", whole);
  Write("groundtruth.txt", "1.0 0 0 0 0 0 0 1\n0.9 0 0 0 0 0 0 1\n");
  EXPECT_THROW((void)ReadSceneTruth(folder_), DataError);
  Write("groundtruth.txt", "1.0 0 0 0 0 0 0 1\n1.1 0 0 0 0 0 0 1\n");
  Write("motion.json", "{}");
  EXPECT_THROW((void)ReadSceneTruth(folder_), DataError);
  fs::remove(folder_ / "motion.json");
  EXPECT_THROW((void)ReadSceneTruth(folder_), DataError);
}

}  // namespace
}  // namespace plumb
