// SPDX-License-Identifier: Apache-2.0
#include "algo/tracking/relocalizer.hpp"

#include <cmath>
#include <random>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "algo/geometry/working_image.hpp"
#include "tests/unit/tracking/synthetic_map.hpp"

namespace plumb {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kLength = synthetic::kMarkerLength;

// A marker seen by an ideal camera, and depth on its plane (the plane fills the image).
struct Sight {
  MarkerObservation marker;
  cv::Mat depth_m;
};

Sight See(const Intrinsics& k, const Pose& T_camera_marker, double noise_px) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  Sight sight;
  const double h = kLength / 2;
  const std::array<Vector3d, 4> corners = {Vector3d(-h, h, 0), Vector3d(h, h, 0),
                                           Vector3d(h, -h, 0), Vector3d(-h, -h, 0)};
  for (std::size_t i = 0; i < 4; ++i) {
    const Vector3d p = T_camera_marker * corners[i];
    sight.marker.corners[i] = Vector2d(k.fx * p.x() / p.z() + k.cx, k.fy * p.y() / p.z() + k.cy) +
                              noise_px * Vector2d(normal(random), normal(random));
  }
  sight.depth_m = cv::Mat::zeros(k.height, k.width, CV_32FC1);
  const Vector3d n = T_camera_marker.linear().col(2);
  const double d = n.dot(T_camera_marker.translation());
  for (int r = 0; r < k.height; ++r) {
    for (int c = 0; c < k.width; ++c) {
      const double z = d / n.dot(Vector3d((c - k.cx) / k.fx, (r - k.cy) / k.fy, 1));
      if (z > 0.1 && z < 5) sight.depth_m.at<float>(r, c) = static_cast<float>(z);
    }
  }
  return sight;
}

Pose Facing(double tilt_x, double tilt_y, double z) {
  Pose T = Pose::Identity();
  T.linear() = Vector3d(1, -1, -1).asDiagonal();
  T.linear() *=
      (Eigen::AngleAxisd(tilt_x, Vector3d::UnitX()) * Eigen::AngleAxisd(tilt_y, Vector3d::UnitY()))
          .toRotationMatrix();
  T.translation() = Vector3d(0.05, -0.03, z);
  return T;
}

TEST(MarkerPose, DepthTellsTheTwoPosesApart) {
  // A small, far, slightly tilted marker: its mirror pose reprojects about as well.
  const Intrinsics k;
  int undecided_without_depth = 0;
  for (const double tilt : {0.3, -0.3, 0.4, -0.4}) {
    for (const bool about_x : {true, false}) {
      const Pose T_true = about_x ? Facing(tilt, 0, 1.2) : Facing(0, tilt, 1.2);
      const Sight sight = See(k, T_true, 0.1);
      const auto found = MarkerPoseInCamera(k, kLength, sight.marker, sight.depth_m);
      ASSERT_TRUE(found.has_value()) << tilt;
      // The mirror would be 2 * tilt away; noise of 0.1 px on a side of 45 px leaves some degrees.
      EXPECT_LT(RotationAngle(T_true.inverse() * *found), std::abs(tilt)) << tilt;
      const auto blind =
          MarkerPoseInCamera(k, kLength, sight.marker, cv::Mat::zeros(480, 640, CV_32FC1));
      undecided_without_depth +=
          blind && RotationAngle(T_true.inverse() * *blind) < std::abs(tilt) ? 0 : 1;
    }
  }
  EXPECT_GE(undecided_without_depth, 1) << "the case is too easy to need depth";
}

TEST(MarkerPose, NearMarkersNeedNoDepth) {
  const Intrinsics k;
  const Pose T_true = Facing(0.7, 0.2, 0.4);
  const Sight sight = See(k, T_true, 0.0);
  const auto found =
      MarkerPoseInCamera(k, kLength, sight.marker, cv::Mat::zeros(480, 640, CV_32FC1));
  ASSERT_TRUE(found.has_value());
  EXPECT_LT(RotationAngle(T_true.inverse() * *found), 1e-4);
  EXPECT_LT((T_true.inverse() * *found).translation().norm(), 1e-5);
}

TEST(MarkerPose, WhatIsNoSquareHasNoPose) {
  const Intrinsics k;
  MarkerObservation crossed;
  crossed.corners = {Vector2d(100, 100), Vector2d(300, 300), Vector2d(300, 100),
                     Vector2d(100, 300)};
  EXPECT_FALSE(
      MarkerPoseInCamera(k, kLength, crossed, cv::Mat::zeros(480, 640, CV_32FC1)).has_value());
}

TEST(RelocalizeByMarkers, FindsTheCameraOverKnownMarkersOnly) {
  auto truth = synthetic::MakeTrueMap({.num_landmarks = 0});
  const cv::Mat no_depth = cv::Mat::zeros(240, 320, CV_32FC1);
  const MapKeyframe& keyframe = truth.map.keyframes[4];
  ASSERT_GE(keyframe.data.markers.size(), 2U);
  const auto found =
      RelocalizeByMarkers(truth.map, truth.stated, kLength, keyframe.data.markers, no_depth);
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->keyframe, 4);
  EXPECT_EQ(found->num_inliers, 4 * static_cast<int>(keyframe.data.markers.size()));
  const Pose error = keyframe.T_world_color.inverse() * found->T_world_color;
  EXPECT_LT(error.translation().norm(), 1e-4);
  EXPECT_LT(RotationAngle(error), 1e-4);
  truth.map.markers.clear();
  EXPECT_FALSE(
      RelocalizeByMarkers(truth.map, truth.stated, kLength, keyframe.data.markers, no_depth)
          .has_value());
}

TEST(RelocalizeByMarkers, RefusesMarkersThatContradictTheMap) {
  auto truth = synthetic::MakeTrueMap({.num_landmarks = 0});
  const std::vector<MarkerObservation>& seen = truth.map.keyframes[4].data.markers;
  ASSERT_GE(seen.size(), 2U);
  truth.map.markers.at(seen[0].id).T_world_marker.translation() +=
      Vector3d(0.3, 0.2, 0.1);  // Someone moved it.
  EXPECT_FALSE(RelocalizeByMarkers(truth.map, truth.stated, kLength, seen,
                                   cv::Mat::zeros(240, 320, CV_32FC1))
                   .has_value());
}

// Rectangles of random grey: corners that ORB likes.
cv::Mat Texture(unsigned seed) {
  std::mt19937 random(seed);
  const auto draw = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  cv::Mat image(700, 900, CV_8UC1, cv::Scalar(120));
  for (int i = 0; i < 1500; ++i)
    image(cv::Rect(draw(860), draw(660), 8 + draw(30), 8 + draw(30))).setTo(20 + draw(220));
  cv::GaussianBlur(image, image, cv::Size(), 0.8);
  return image;
}

// The texture on a wall at 0.8 m, seen after a shift along the wall and a turn about the optical
// axis.
cv::Mat Photo(const cv::Mat& texture, const Intrinsics& k, const Pose& T_wall_camera) {
  cv::Mat image(k.height, k.width, CV_8UC1);
  cv::Mat map_x(k.height, k.width, CV_32FC1);
  cv::Mat map_y(k.height, k.width, CV_32FC1);
  for (int r = 0; r < k.height; ++r) {
    for (int c = 0; c < k.width; ++c) {
      const Vector3d p = T_wall_camera * (0.8 * Vector3d((c - k.cx) / k.fx, (r - k.cy) / k.fy, 1));
      map_x.at<float>(r, c) = static_cast<float>(450 + p.x() * k.fx / 0.8);
      map_y.at<float>(r, c) = static_cast<float>(350 + p.y() * k.fy / 0.8);
    }
  }
  cv::remap(texture, image, map_x, map_y, cv::INTER_LINEAR);
  return image;
}

TEST(RelocalizeByFeatures, FindsTheKeyframeAndThePose) {
  const Intrinsics k;
  const cv::Mat depth(480, 640, CV_32FC1, cv::Scalar(0.8));
  TrackingMap map;
  for (const unsigned seed : {1U, 2U, 3U}) {
    MapKeyframe keyframe;
    keyframe.T_world_color.translation() = Vector3d(2.0 * seed, 0, 0);
    DescribedFeatures features =
        DescribeFeatures(Photo(Texture(seed), k, Pose::Identity()), depth, k);
    keyframe.features_px = features.pixels;
    keyframe.features_camera = features.in_camera;
    keyframe.descriptors = features.descriptors;
    map.keyframes.push_back(keyframe);
  }
  const std::vector<int> all = {2, 1, 0};
  const Pose T_motion = PoseFromTwist((Vector6d() << 0, 0, 0.35, 0.08, -0.05, 0).finished());
  const auto found =
      RelocalizeByFeatures(map, k, DescribeFeatures(Photo(Texture(2), k, T_motion), depth, k), all);
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->keyframe, 1);
  const Pose error = (map.keyframes[1].T_world_color * T_motion).inverse() * found->T_world_color;
  fmt::print("features: {} inliers, {:.2e} m {:.2e} rad\n", found->num_inliers,
             error.translation().norm(), RotationAngle(error));
  EXPECT_LT(error.translation().norm(), 0.003);
  EXPECT_LT(RotationAngle(error), 0.004);
  EXPECT_FALSE(
      RelocalizeByFeatures(map, k, DescribeFeatures(Photo(Texture(9), k, T_motion), depth, k), all)
          .has_value())
      << "never seen";
  EXPECT_FALSE(RelocalizeByFeatures(
                   map, k, DescribeFeatures(cv::Mat::zeros(480, 640, CV_8UC1), depth, k), all)
                   .has_value())
      << "black";
}

TEST(RelocalizeByFeatures, ReadsDepthAtWorkingResolutionInItsPlace) {
  const Intrinsics k;
  cv::Mat depth_m(k.height, k.width, CV_32FC1);
  for (int column = 0; column < k.width; ++column) depth_m.col(column).setTo(0.8 + 0.001 * column);
  const cv::Mat photo = Photo(Texture(1), k, Pose::Identity());
  const DescribedFeatures full = DescribeFeatures(photo, depth_m, k);
  const DescribedFeatures working = DescribeFeatures(photo, WorkingDepth(depth_m, k, {}), k);
  ASSERT_GT(full.pixels.size(), 200U);
  ASSERT_EQ(working.pixels.size(), full.pixels.size());
  double full_m = 0, working_m = 0;  // Mean errors: 0.5 mm would be half a column.
  for (std::size_t i = 0; i < full.pixels.size(); ++i) {
    const double true_m = 0.8 + 0.001 * full.pixels[i].x();
    full_m += (full.in_camera[i].z() - true_m) / static_cast<double>(full.pixels.size());
    working_m += (working.in_camera[i].z() - true_m) / static_cast<double>(full.pixels.size());
  }
  fmt::print("features: {:.3f} mm, at working resolution {:.3f} mm\n", 1e3 * full_m,
             1e3 * working_m);
  EXPECT_LT(std::abs(full_m), 1e-4);
  EXPECT_LT(std::abs(working_m), 1e-4);
}

TEST(NearestKeyframe, WeighsDistanceAndAngle) {
  TrackingMap map;
  map.keyframes.resize(3);
  map.keyframes[1].T_world_color.translation() = Vector3d(0.2, 0, 0);
  map.keyframes[2].T_world_color = PoseFromTwist((Vector6d() << 0, 1.0, 0, 0.21, 0, 0).finished());
  EXPECT_EQ(NearestKeyframe(map, PoseFromTwist((Vector6d() << 0, 0, 0, 0.205, 0, 0).finished())),
            1);
  EXPECT_EQ(NearestKeyframe(map, PoseFromTwist((Vector6d() << 0, 0.9, 0, 0.205, 0, 0).finished())),
            2);
}

}  // namespace
}  // namespace plumb
