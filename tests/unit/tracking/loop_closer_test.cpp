// SPDX-License-Identifier: Apache-2.0
#include "algo/tracking/loop_closer.hpp"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace plumb {
namespace {

using Eigen::Vector3d;

constexpr int kNumKeyframes = 40;
constexpr int kLandmarksEach = 20;

Pose TrueCamera(int k) {
  // Once round a circle of 1 m, looking inward.
  const double angle = 2 * std::numbers::pi * k / (kNumKeyframes - 1);
  Pose T = Pose::Identity();
  T.linear() = Eigen::AngleAxisd(angle, Vector3d::UnitY()).toRotationMatrix();
  T.translation() = Vector3d(-std::sin(angle), 0, -std::cos(angle));
  return T;
}

// A walk round a circle whose every step is a little too long and turned: the last camera, truly
// where the first is, is far off. Each keyframe shares `kLandmarksEach` landmarks with the next.
TrackingMap DriftedCircle(const Vector6d& drift_a_step) {
  TrackingMap map;
  for (int k = 0; k < kNumKeyframes; ++k) {
    MapKeyframe keyframe;
    if (k > 0) {
      keyframe.previous = k - 1;
      keyframe.T_previous_color =
          TrueCamera(k - 1).inverse() * TrueCamera(k) * PoseFromTwist(drift_a_step);
      keyframe.T_world_color = map.keyframes.back().T_world_color * keyframe.T_previous_color;
      for (int i = 0; i < kLandmarksEach; ++i)
        keyframe.keypoints.push_back({(k - 1) * kLandmarksEach + i, {0, 0}, 1.0});
    } else {
      keyframe.T_world_color = TrueCamera(0);
    }
    for (int i = 0; i < kLandmarksEach; ++i) {
      Landmark landmark;
      landmark.p_world = keyframe.T_world_color * Vector3d(0.01 * i, 0, 1);
      landmark.first_keyframe = k;
      landmark.num_observations = 2;
      keyframe.keypoints.push_back({static_cast<int>(map.landmarks.size()), {0, 0}, 1.0});
      map.landmarks.push_back(landmark);
    }
    keyframe.descriptors = cv::Mat::zeros(20, 32, CV_8UC1);
    map.keyframes.push_back(keyframe);
  }
  return map;
}

const Vector6d kDrift = (Vector6d() << 0, 0.002, 0.0005, 0.002, 0, 0.001).finished();

double WorstError(const TrackingMap& map) {
  double worst = 0;
  for (int k = 0; k < kNumKeyframes; ++k)
    worst = std::max(
        worst, (map.keyframe(k).T_world_color.translation() - TrueCamera(k).translation()).norm());
  return worst;
}

TEST(LoopCandidates, AreOldKeyframesWithinTheDriftThatShareNoLandmarks) {
  TrackingMap map = DriftedCircle(kDrift);
  const std::vector<int> candidates = LoopCandidates(map);
  ASSERT_FALSE(candidates.empty());
  EXPECT_LE(candidates.size(), 4U);
  for (const int k : candidates)
    EXPECT_LE(k, 6) << "looks the other way, or is the last one's neighbour";
  // Already known to each other.
  for (std::size_t i = 0; i < 7; ++i)
    for (int id = 0; id < 10; ++id)
      map.keyframes[i].keypoints.push_back(
          {(kNumKeyframes - 1) * kLandmarksEach + id, {0, 0}, 1.0});
  EXPECT_THAT(LoopCandidates(map), testing::IsEmpty());
  map.keyframes.resize(kLoopMinGap);
  EXPECT_THAT(LoopCandidates(map), testing::IsEmpty()) << "too young a map";
  EXPECT_THAT(LoopCandidates(TrackingMap{}), testing::IsEmpty());
}

TEST(LargestDrift, GrowsWithTheWay) {
  const TrackingMap map = DriftedCircle(Vector6d::Zero());
  const DriftBound near = LargestDrift(map, 30);
  const DriftBound far = LargestDrift(map, 0);
  EXPECT_GT(far.translation_m, near.translation_m + 0.1);
  EXPECT_GT(far.rotation_rad, near.rotation_rad + 0.05);
  EXPECT_LT(far.translation_m, 1.0);
}

TEST(DistributeLoopError, SpreadsTheDriftOverTheWay) {
  TrackingMap map = DriftedCircle(kDrift);
  const double before = WorstError(map);
  ASSERT_GT(before, 0.08);
  const Pose T_first = map.keyframes[0].T_world_color;
  DistributeLoopError(
      {{0, kNumKeyframes - 1, TrueCamera(0).inverse() * TrueCamera(kNumKeyframes - 1)}}, map);
  const Pose T_ends =
      map.keyframes.front().T_world_color.inverse() * map.keyframes.back().T_world_color;
  EXPECT_LT(T_ends.translation().norm(), 0.1 * before);
  EXPECT_LT(WorstError(map), 0.35 * before);
  EXPECT_TRUE(map.keyframes[0].T_world_color.isApprox(T_first, 1e-12));
  // Landmarks stay where the keyframe that saw them first saw them.
  for (const Landmark& landmark : map.landmarks) {
    const Vector3d p =
        map.keyframe(landmark.first_keyframe).T_world_color.inverse() * landmark.p_world;
    ASSERT_NEAR(p.z(), 1.0, 1e-9);
  }
  // Neighbours still stand to each other nearly as before.
  for (std::size_t k = 1; k < map.keyframes.size(); ++k) {
    const Pose T = map.keyframes[k - 1].T_world_color.inverse() * map.keyframes[k].T_world_color;
    ASSERT_LT((map.keyframes[k].T_previous_color.inverse() * T).translation().norm(), 0.006) << k;
  }
}

TEST(DistributeLoopError, MovesMarkersWithTheKeyframeThatSawThemFirst) {
  TrackingMap map = DriftedCircle(kDrift);
  MarkerObservation seen;
  seen.id = 7;
  map.keyframes[20].data.markers.push_back(seen);
  map.keyframes[35].data.markers.push_back(seen);
  map.markers[7] = {map.keyframes[20].T_world_color * Pose(Eigen::Translation3d(0, 0, 1)), 2};
  DistributeLoopError(
      {{0, kNumKeyframes - 1, TrueCamera(0).inverse() * TrueCamera(kNumKeyframes - 1)}}, map);
  EXPECT_NEAR(
      (map.keyframes[20].T_world_color.inverse() * map.markers[7].T_world_marker.translation() -
       Vector3d(0, 0, 1))
          .norm(),
      0, 1e-9);
}

TEST(DistributeLoopError, LeavesAMapThatAgreesWithItsLinks) {
  TrackingMap map = DriftedCircle(Vector6d::Zero());
  DistributeLoopError(
      {{0, kNumKeyframes - 1, TrueCamera(0).inverse() * TrueCamera(kNumKeyframes - 1)}}, map);
  EXPECT_LT(WorstError(map), 1e-9);
}

TEST(LinkEquations, AgreeWithFiniteDifferences) {
  const Pose T_a = PoseFromTwist((Vector6d() << 0.3, -0.2, 0.1, 1, 2, 3).finished());
  const Pose T_b = T_a * PoseFromTwist((Vector6d() << 0.1, 0.2, -0.3, 0.3, -0.1, 0.2).finished());
  KeyframeLink link{
      0, 1,
      T_a.inverse() * T_b *
          PoseFromTwist((Vector6d() << 2e-4, -1e-4, 3e-4, 0.003, 0.001, -0.002).finished())};
  const double sigma_rad = 0.01, sigma_m = 0.02;
  const auto cost = [&](const Eigen::Matrix<double, 12, 1>& x) {
    const Pose T =
        (T_a * PoseFromTwist(x.head<6>())).inverse() * (T_b * PoseFromTwist(x.tail<6>()));
    const Vector3d turn =
        VectorFromRotation(link.T_a_b.linear().transpose() * T.linear()) / sigma_rad;
    return 0.5 * (turn.squaredNorm() +
                  ((T.translation() - link.T_a_b.translation()) / sigma_m).squaredNorm());
  };
  const LinkEquations equations = Linearise(link, T_a, T_b, sigma_rad, sigma_m);
  for (int i = 0; i < 12; ++i) {
    Eigen::Matrix<double, 12, 1> step = Eigen::Matrix<double, 12, 1>::Zero();
    step[i] = 1e-5;
    const double slope = (cost(step) - cost(-step)) / 2e-5;
    EXPECT_NEAR(equations.g[i], slope, 1e-3 * equations.g.cwiseAbs().maxCoeff()) << i;
    const double curvature = (cost(step) + cost(-step) - 2 * cost(0 * step)) / 1e-10;
    EXPECT_NEAR(equations.H(i, i), curvature, 0.01 * equations.H.diagonal().maxCoeff()) << i;
  }
}

TEST(IsConstrained, ByLandmarksThatOthersSeeOrByAMarker) {
  TrackingMap map = DriftedCircle(Vector6d::Zero());
  EXPECT_TRUE(IsConstrained(map, map.keyframes[5]));
  for (Landmark& landmark : map.landmarks) landmark.num_observations = 1;
  EXPECT_FALSE(IsConstrained(map, map.keyframes[5]));
  MarkerObservation seen;
  seen.id = 3;
  map.keyframes[5].data.markers.push_back(seen);
  EXPECT_FALSE(IsConstrained(map, map.keyframes[5])) << "a marker that the map does not know";
  map.markers[3] = {};
  EXPECT_TRUE(IsConstrained(map, map.keyframes[5]));
}

}  // namespace
}  // namespace plumb
