// SPDX-License-Identifier: Apache-2.0
#include "algo/diagnosis/marker_depth.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/unit/markers/marker_scene.hpp"

namespace plumb {
namespace {

constexpr double kLength_m = 0.104;

// A keyframe that faces two markers on a plane 0.8 m away, with depth that is `factor` times true.
TrackingMap MapWithDepth(double factor, const Intrinsics& camera, float hole_to_column = 0) {
  TrackingMap map;
  MapKeyframe& keyframe = map.keyframes.emplace_back();
  keyframe.data.view.depth_m =
      cv::Mat(camera.height, camera.width, CV_32FC1, cv::Scalar(0.8 * factor));
  keyframe.data.view.depth_m.colRange(0, static_cast<int>(hole_to_column)).setTo(0);
  for (const int id : {4, 9}) {
    testing::PlacedMarker placed{id};
    placed.T_camera_marker.linear() = RotationFromVector(Eigen::Vector3d(M_PI, 0, 0));
    placed.T_camera_marker.translation() = Eigen::Vector3d(id == 4 ? -0.2 : 0.2, 0.05, 0.8);
    keyframe.data.markers.push_back(
        {.id = id, .corners = testing::TrueCorners(placed, kLength_m, camera)});
  }
  return map;
}

TEST(MarkerDepthTest, IsTheFactorBetweenDepthAndSize) {
  const Intrinsics camera{640, 480, 527.0, 526.0, 318.3, 244.1, {0.05, -0.1, 0, 0, 0}};
  for (const double factor : {1.0, 0.97, 5.0, 0.2}) {
    const auto measured = MeasureMarkerDepths(MapWithDepth(factor, camera), camera, {}, kLength_m);
    ASSERT_EQ(measured.size(), 2U);
    EXPECT_EQ(measured[0].id, 4);
    EXPECT_EQ(measured[1].num_views, 1);
    for (const MarkerDepth& marker : measured) EXPECT_NEAR(marker.ratio / factor, 1.0, 1e-3);
  }
}

TEST(MarkerDepthTest, AFaceWithoutDepthIsNotMeasured) {
  const Intrinsics camera{640, 480, 527.0, 526.0, 318.3, 244.1, {}};
  const auto measured = MeasureMarkerDepths(MapWithDepth(1.0, camera, 300), camera, {}, kLength_m);
  ASSERT_EQ(measured.size(), 1U);
  EXPECT_EQ(measured[0].id, 9);
}

TEST(MarkerDepthTest, WhatIsKnownOfTheSensorIsTakenOut) {
  const Intrinsics camera{640, 480, 527.0, 526.0, 318.3, 244.1, {}};
  CalibrationModel known;
  known.depth[kDepthScale] = 0.04;
  const auto measured =
      MeasureMarkerDepths(MapWithDepth(1.0 / 1.04, camera), camera, known, kLength_m);
  ASSERT_EQ(measured.size(), 2U);
  EXPECT_NEAR(measured[0].ratio, 1.0, 1e-3);
}

}  // namespace
}  // namespace plumb
