// SPDX-License-Identifier: Apache-2.0
#include "algo/bundle/witnesses.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "algo/bundle/bundle_adjustment.hpp"
#include "tests/unit/tracking/synthetic_map.hpp"

namespace plumb {
namespace {

using synthetic::kMarkerLength;
using synthetic::MakeTrueMap;
using synthetic::TrueMap;

constexpr synthetic::MapOptions kSweep{
    .num_keyframes = 24, .num_landmarks = 900, .pixel_noise = 0.2};

WitnessErrors ErrorsOf(const TrueMap& truth, const TrackingMap& map) {
  return ErrorsOfWitnesses(truth.stated, {}, kMarkerLength, map);
}

// A path that grows by a part of its length towards its end, as a bent depth image makes it.
TrackingMap Stretched(const TrackingMap& map, double part) {
  TrackingMap bent = map;
  const Eigen::Vector3d from = map.keyframes.front().T_world_color.translation();
  for (MapKeyframe& keyframe : bent.keyframes) {
    const Eigen::Vector3d way = keyframe.T_world_color.translation() - from;
    keyframe.T_world_color.translation() += part * way.x() * way;
  }
  return bent;
}

TEST(Witnesses, SeeTheirOwnNoiseAtTheTruth) {
  const TrueMap truth = MakeTrueMap(kSweep);
  const WitnessErrors errors = ErrorsOf(truth, truth.map);
  fmt::print("{} keypoints {:.3f} px, {} corners {:.3f} px\n", errors.num_keypoints,
             errors.keypoints_px, errors.num_corners, errors.corners_px);
  EXPECT_GT(errors.num_keypoints, 100);
  EXPECT_GE(errors.num_corners, 16);
  // Noise of 0.2 pixels at 320 columns is 0.4 at 640; the median distance in two dimensions is 1.18
  // standard deviations, and a landmark takes up some of it.
  EXPECT_NEAR(errors.corners_px, 1.18 * 0.4, 0.1);
  EXPECT_LT(errors.keypoints_px, 1.18 * 0.4);
  EXPECT_GT(errors.keypoints_px, 0.6 * 1.18 * 0.4);
}

TEST(Witnesses, DoNotMoveTheSolution) {
  TrueMap truth = MakeTrueMap(kSweep);
  // Only witnesses are wrong, and by a lot.
  TrackingMap map = truth.map;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
    for (KeypointObservation& o : map.keyframes[k].keypoints)
      if (IsWitness(map.landmark(o.landmark), o.landmark)) o.pixel += Eigen::Vector2d(6, -4);
    for (MarkerObservation& m : map.keyframes[k].data.markers)
      if (IsWitness(map.markers.at(m.id), m.id, static_cast<int>(k)))
        for (Eigen::Vector2d& corner : m.corners) corner += Eigen::Vector2d(6, -4);
  }
  const auto solve = [&](TrackingMap of, bool keep_out) {
    BundleOptions options;
    options.marker_length_m = kMarkerLength;
    options.keep_witnesses_out = keep_out;
    for (int k = 1; k < kSweep.num_keyframes; ++k) options.free_keyframes.push_back(k);
    CalibrationModel calibration;
    BundleAdjust(truth.stated, options, {}, of, calibration);
    return of.keyframes.back().T_world_color.matrix();
  };
  EXPECT_EQ(solve(map, true), solve(truth.map, true));
  EXPECT_NE(solve(map, false), solve(truth.map, false)) << "nothing pulls: nothing is tested";
}

TEST(Witnesses, ContradictABentPath) {
  const TrueMap truth = MakeTrueMap(kSweep);
  const WitnessErrors before = ErrorsOf(truth, truth.map);
  const WitnessErrors after = ErrorsOf(truth, Stretched(truth.map, 0.03));
  fmt::print("keypoints {:.3f} -> {:.3f} px, corners {:.3f} -> {:.3f} px\n", before.keypoints_px,
             after.keypoints_px, before.corners_px, after.corners_px);
  EXPECT_TRUE(ContradictsWitnesses(before, after));
  EXPECT_FALSE(ContradictsWitnesses(after, before));
  EXPECT_FALSE(ContradictsWitnesses(before, before));
}

// 400 values: a tenth and four standard deviations of a twentieth are tolerated.
TEST(Witnesses, ContradictBeyondChanceAndATenthOnly) {
  WitnessErrors before{
      .keypoints_px = 0.5, .corners_px = 0.1, .num_keypoints = 400, .num_corners = 400};
  const auto contradicted = [&](double keypoints, double corners, int count) {
    return ContradictsWitnesses(before, {.keypoints_px = 0.5 * keypoints,
                                         .corners_px = 0.1 * corners,
                                         .num_keypoints = count,
                                         .num_corners = count});
  };
  EXPECT_FALSE(contradicted(1.29, 1.0, 400));
  EXPECT_TRUE(contradicted(1.31, 1.0, 400));
  EXPECT_FALSE(contradicted(1.0, 1.29, 400));
  EXPECT_TRUE(contradicted(1.0, 1.31, 400));
  // Fewer than 40 values say nothing.
  EXPECT_FALSE(contradicted(9.0, 9.0, 39));
  EXPECT_TRUE(contradicted(9.0, 9.0, 40));
}

}  // namespace
}  // namespace plumb
