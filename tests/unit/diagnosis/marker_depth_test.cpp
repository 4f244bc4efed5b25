// SPDX-License-Identifier: Apache-2.0
#include "algo/diagnosis/marker_depth.hpp"

#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "algo/geometry/working_image.hpp"
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

// The depth of a map's keyframes may be at working resolution, of which 848 columns are no
// multiple. It grows by 0.2 % with each column; means over places between two columns.
TEST(MarkerDepthTest, DepthAtWorkingResolutionIsReadInItsPlace) {
  for (const int width : {640, 848}) {
    const Intrinsics camera{width, 480, 527.0, 526.0, 0.5 * width, 244.1, {}};
    cv::Mat depth_m(camera.height, camera.width, CV_32FC1);
    for (int column = 0; column < width; ++column)
      depth_m.col(column).setTo(0.8 * (1 + 0.002 * (column - 0.5 * width)));
    const cv::Mat working_m = WorkingDepth(depth_m, camera, {});
    ASSERT_LT(working_m.cols, width);
    constexpr int kPlaces = 30;
    double off = 0;
    for (int i = 0; i < kPlaces; ++i) {
      testing::PlacedMarker placed{4};
      placed.T_camera_marker.linear() = RotationFromVector(Eigen::Vector3d(M_PI, 0, 0));
      placed.T_camera_marker.translation() = Eigen::Vector3d(0.0007 * (i - kPlaces / 2), 0.05, 0.8);
      const MarkerObservation marker{.id = 4,
                                     .corners = testing::TrueCorners(placed, kLength_m, camera)};
      const auto full = DepthRatioOnFace(marker, depth_m, camera, kLength_m);
      const auto reduced = DepthRatioOnFace(marker, working_m, camera, kLength_m);
      ASSERT_TRUE(full && reduced);
      off += (*reduced - *full) / 0.002 / kPlaces;
    }
    fmt::print("{} columns: {:.3f} columns off\n", width, off);
    EXPECT_LT(std::abs(off), 0.2) << width;
  }
}

// Six views of two markers at 0.8 and 1 m, in opposite quarters of the image; the other quarters
// have depths of their own.
TrackingMap MapOfQuarters(const Intrinsics& camera) {
  cv::Mat depth_m(camera.height, camera.width, CV_32FC1);
  const cv::Rect quarter(0, 0, camera.width / 2, camera.height / 2);
  const cv::Point across(quarter.width, 0), down(0, quarter.height);
  depth_m(quarter).setTo(0.8);
  depth_m(quarter + across).setTo(1.3);
  depth_m(quarter + down).setTo(0.5);
  depth_m(quarter + across + down).setTo(1.0);
  TrackingMap map;
  for (int view = 0; view < 6; ++view) {
    MapKeyframe& keyframe = map.keyframes.emplace_back();
    keyframe.data.view.depth_m = depth_m.clone();
    for (const int id : {4, 9}) {
      const double side = id == 4 ? -1 : 1;
      testing::PlacedMarker placed{id};
      placed.T_camera_marker.linear() = RotationFromVector(Eigen::Vector3d(M_PI, 0, 0));
      placed.T_camera_marker.translation() =
          Eigen::Vector3d(0.2 * side, 0.15 * side, 0.9 + 0.1 * side);
      keyframe.data.markers.push_back(
          {.id = id, .corners = testing::TrueCorners(placed, kLength_m, camera)});
    }
  }
  return map;
}

TEST(MarkerDepthTest, AMirroredOrTurnedDepthImageIsRecognised) {
  const Intrinsics camera{640, 480, 527.0, 526.0, 319.5, 239.5, {}};
  using Turn = std::pair<DepthLayout, int>;
  for (const auto& [layout, flip] :
       {Turn{DepthLayout::kMirrored, 1}, Turn{DepthLayout::kUpsideDown, 0},
        Turn{DepthLayout::kTurned, -1}}) {
    TrackingMap map = MapOfQuarters(camera);
    EXPECT_EQ(FindDepthLayout(map, camera, {}, kLength_m), DepthLayout::kAsStated);
    for (MapKeyframe& keyframe : map.keyframes) {
      cv::Mat& depth_m = keyframe.data.view.depth_m;
      cv::flip(depth_m.clone(), depth_m, flip);
    }
    EXPECT_EQ(FindDepthLayout(map, camera, {}, kLength_m), layout);
    for (MapKeyframe& keyframe : map.keyframes)
      keyframe.data.view.depth_m = WorkingDepth(keyframe.data.view.depth_m, camera, {});
    EXPECT_EQ(FindDepthLayout(map, camera, {}, kLength_m), layout);
    map.keyframes.resize(5);  // Ten views are too few to say it.
    EXPECT_EQ(FindDepthLayout(map, camera, {}, kLength_m), DepthLayout::kAsStated);
  }
}

TEST(MarkerDepthTest, DepthThatFitsInNoLayoutIsNotCalledMirrored) {
  const Intrinsics camera{640, 480, 527.0, 526.0, 319.5, 239.5, {}};
  TrackingMap map = MapOfQuarters(camera);
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    map.keyframes[k].data.view.depth_m *= 0.7 + 0.1 * static_cast<double>(k);
  EXPECT_EQ(FindDepthLayout(map, camera, {}, kLength_m), DepthLayout::kAsStated);
}

}  // namespace
}  // namespace plumb
