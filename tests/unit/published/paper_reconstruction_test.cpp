// SPDX-License-Identifier: Apache-2.0
#include "algo/published/paper_reconstruction.hpp"

#include <random>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "tests/support/analytic_scene.hpp"

namespace plumb {
namespace {

using testing::DomeScene;

constexpr double kLength = 0.104;
constexpr int kReference = 95;

/// Markers flat on the dome's floor, turned about z. The truth of the test.
std::map<int, Pose> MarkersOnFloor() {
  std::map<int, Pose> T_world_marker;
  const std::vector<std::tuple<int, double, double, double>> places = {
      {kReference, 0.15, 0.12, 0.1},
      {3, 0.85, 0.12, -0.6},
      {4, 0.18, 0.6, 2.0},
      {5, 0.82, 0.6, 1.2}};
  for (const auto& [id, x, y, angle] : places) {
    Pose T = Pose::Identity();
    T.linear() = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    T.translation() = Eigen::Vector3d(x, y, 0);
    T_world_marker[id] = T;
  }
  return T_world_marker;
}

bool AllInside(const MarkerObservation& marker, const Intrinsics& intrinsics) {
  return std::all_of(marker.corners.begin(), marker.corners.end(), [&](const Eigen::Vector2d& c) {
    return c.x() > 1 && c.y() > 1 && c.x() < intrinsics.width - 2 && c.y() < intrinsics.height - 2;
  });
}

/// Keyframes of a sweep with exact images and corners; the poses that tracking claims are off by
/// `error_m`.
std::vector<Keyframe> Sweep(double error_m) {
  std::vector<Keyframe> keyframes;
  std::mt19937 random(4);
  std::normal_distribution<double> normal(0.0, error_m);
  for (DepthView& view : testing::SweepOverDome(DomeScene{}, 8, 320, 0.0)) {
    Keyframe keyframe;
    const Pose T_camera_world = view.T_world_camera.inverse();
    for (const auto& [id, T_world_marker] : MarkersOnFloor()) {
      MarkerObservation seen;
      seen.id = id;
      const MarkerCorners corners = CornersInMarkerFrame(kLength);
      for (std::size_t k = 0; k < 4; ++k)
        seen.corners[k] = Project(view.intrinsics, T_camera_world * T_world_marker * corners[k]);
      if (AllInside(seen, view.intrinsics)) keyframe.markers.push_back(seen);
    }
    Vector6d twist;
    for (int i = 0; i < 6; ++i) twist[i] = normal(random);
    view.T_world_camera = view.T_world_camera * PoseFromTwist(twist);
    keyframe.view = view;
    keyframes.push_back(keyframe);
  }
  return keyframes;
}

TEST(PaperReconstructionTest, ExactPosesGiveTheTrueHeightMapInTheReferenceMarkersFrame) {
  const DomeScene dome;
  const std::vector<Keyframe> keyframes = Sweep(0.0);
  const std::vector<Pose> no_correction(keyframes.size(), Pose::Identity());
  const MarkerMap markers = AverageMarkers(keyframes, no_correction);
  const auto truth = MarkersOnFloor();
  ASSERT_EQ(markers.size(), truth.size());
  for (const auto& [id, marker] : markers) {
    const MarkerCorners corners = CornersInMarkerFrame(kLength);
    EXPECT_GE(marker.num_views, 1);
    // Depth of the nearest pixel: half a working pixel (3.5 mm) on a floor seen up to 35 deg off:
    // measured up to 1.3 mm.
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_LT((marker.corners[k] - truth.at(id) * corners[k]).norm(), 2.5e-3) << "marker " << id;
  }
  const auto T_marker_world = ReferenceFrame(markers, kReference, kLength);
  ASSERT_TRUE(T_marker_world.has_value());
  const Pose T_error = *T_marker_world * truth.at(kReference);
  EXPECT_LT(T_error.translation().norm(), 1.5e-3);
  // The marker's z comes out of the print: the cameras lie above it.
  for (const Keyframe& keyframe : keyframes)
    EXPECT_GT((*T_marker_world * keyframe.view.T_world_camera.translation()).z(), 0.5);

  const HeightMap map = HeightMapOfKeyframes(KeyframeClouds(keyframes), no_correction,
                                             truth.at(kReference).inverse());
  std::vector<double> errors;
  for (int row = 0; row < map.grid.height; ++row) {
    for (int column = 0; column < map.grid.width; ++column) {
      if (std::isnan(map.at(row, column))) continue;
      const Eigen::Vector3d p =
          truth.at(kReference) *
          Eigen::Vector3d(map.grid.x_centre(column), map.grid.y_centre(row), map.at(row, column));
      if (dome.Height(p.x(), p.y()) > 0.0 && dome.Normal(p.x(), p.y()).z() > 0.7)
        errors.push_back(std::abs(p.z() - dome.Height(p.x(), p.y())));
    }
  }
  ASSERT_GT(errors.size(), 20000U);
  std::sort(errors.begin(), errors.end());
  // Exact depth; what is left is where in its cell a point lies (0.75 mm times the slope). Measured
  // median 0.15 mm.
  EXPECT_LT(errors[errors.size() / 2], 0.5e-3);
  EXPECT_LT(errors[errors.size() * 95 / 100], 1.5e-3);
}

TEST(PaperReconstructionTest, AllStagesRunInOrderAndImproveTheAgreementOfTheClouds) {
  const std::vector<Keyframe> keyframes = Sweep(0.004);
  std::vector<std::string> stages;
  PaperOptions options;
  options.room_markers.length_m = kLength;
  options.room_markers.reference = kReference;
  double last_fraction = 0.0;
  const PaperReconstruction result = ReconstructAsPublished(
      keyframes, options, {}, [&](std::string_view stage) { stages.emplace_back(stage); },
      [&](double fraction) { last_fraction = fraction; });
  EXPECT_THAT(stages,
              ::testing::ElementsAre("clouds", "global_registration", "markers", "height_map", ""));
  EXPECT_EQ(last_fraction, 1.0);
  EXPECT_EQ(result.T_refined_world.size(), keyframes.size());
  ASSERT_EQ(result.icp_rms_m.size(), 20U);
  EXPECT_LT(result.icp_rms_m.back(), result.icp_rms_m.front());
  ASSERT_TRUE(result.height_map.has_value());
  EXPECT_EQ(result.height_map->grid.width, 1400);
  // Corners are placed by T_j P_j: they are where the corrected keyframes see them, not near the
  // world's origin.
  const auto truth = MarkersOnFloor();
  for (const auto& [id, marker] : result.markers_in_world)
    EXPECT_LT((marker.corners[0] - truth.at(id) * CornersInMarkerFrame(kLength)[0]).norm(), 0.03);
}

TEST(PaperReconstructionTest, RefusesMarkersWhoseLengthWasNeverSet) {
  PaperOptions options;
  options.icp.num_iterations = 1;
  options.room_markers.reference = kReference;
  EXPECT_THROW((void)ReconstructAsPublished(Sweep(0.0), options), std::invalid_argument);
}

TEST(PaperReconstructionTest, WithoutTheReferenceMarkerThereIsNoHeightMap) {
  const std::vector<Keyframe> keyframes = Sweep(0.0);
  PaperOptions options;
  options.room_markers.length_m = kLength;
  options.icp.num_iterations = 1;
  EXPECT_FALSE(ReconstructAsPublished(keyframes, options).height_map.has_value());
  options.room_markers.reference = 1234;
  const PaperReconstruction result = ReconstructAsPublished(keyframes, options);
  EXPECT_FALSE(result.T_marker_world.has_value());
  EXPECT_FALSE(result.height_map.has_value());
  EXPECT_FALSE(result.markers_in_world.empty());
}

TEST(PaperReconstructionTest, StopsOnRequestAndNamesMistakes) {
  std::vector<Keyframe> keyframes = Sweep(0.0);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW((void)ReconstructAsPublished(keyframes, {}, stop.get_token()), Interrupted);
  EXPECT_THROW((void)AverageMarkers(keyframes, std::vector<Pose>(3)), std::invalid_argument);
  keyframes[1].view.depth_m = cv::Mat::zeros(240, 320, CV_32FC1);
  try {
    (void)KeyframeClouds(keyframes);
    FAIL() << "a keyframe without depth was accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("keyframe 1"));
  }
}

}  // namespace
}  // namespace plumb
