// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/velocity_refinement.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>

#include "tests/unit/tracking/synthetic_map.hpp"

namespace plumb {
namespace {

using synthetic::MakeTrueMap;
using synthetic::TrueMap;

// How fast the picture of a point 0.9 m ahead of the camera moves, and how the picture turns and
// grows: what an image shows of a velocity. Turning about y and shifting along x look alike.
Eigen::Vector4d ImageFlow(const Vector6d& velocity) {
  constexpr double kAhead_m = 0.9;
  return {velocity[0] - velocity[4] / kAhead_m, velocity[1] + velocity[3] / kAhead_m, velocity[2],
          velocity[5] / kAhead_m};
}

double FlowError(const TrackingMap& map, const TrackingMap& truth) {
  double sum = 0;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    sum += ImageFlow(map.keyframes[k].velocity_per_s - truth.keyframes[k].velocity_per_s)
               .squaredNorm();
  return std::sqrt(sum / static_cast<double>(map.keyframes.size()));
}

// As a trembling hand leaves them: off by what the neighbours' poses do not show.
void DisturbVelocities(TrackingMap& map) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (MapKeyframe& keyframe : map.keyframes)
    for (int i = 0; i < 6; ++i)
      keyframe.velocity_per_s[i] += (i < 3 ? 0.05 : 0.03) * normal(random);
}

synthetic::MapOptions WithReadout() {
  synthetic::MapOptions options;
  options.sensor.readout_s[0] = 0.025;
  options.pixel_noise = 0.03;
  return options;
}

VelocityOptions Options() {
  VelocityOptions options;
  options.marker_length_m = synthetic::kMarkerLength;
  options.keypoint_sigma_px = 0.12;  // At 640 columns, twice the noise below at 320.
  return options;
}

TEST(RefineVelocities, RefusesMarkersWhoseLengthWasNeverSet) {
  const TrueMap truth = MakeTrueMap(WithReadout());
  TrackingMap map = truth.map;
  EXPECT_THROW(RefineVelocities(truth.stated, WithReadout().sensor, {}, map),
               std::invalid_argument);
}

TEST(RefineVelocities, FindsWhatTheRowsShow) {
  const TrueMap truth = MakeTrueMap(WithReadout());
  TrackingMap map = truth.map;
  DisturbVelocities(map);
  const double before = FlowError(map, truth.map);
  RefineVelocities(truth.stated, WithReadout().sensor, Options(), map);
  EXPECT_LT(FlowError(map, truth.map), 0.4 * before);
}

TEST(RefineVelocities, MarkersAloneShowItToo) {
  synthetic::MapOptions options = WithReadout();
  options.num_landmarks = 0;
  TrueMap truth = MakeTrueMap(options);
  std::erase_if(truth.map.keyframes, [](const MapKeyframe& keyframe) {
    return keyframe.data.markers.size() < 3;  // Two markers do not hold a pose and a velocity.
  });
  ASSERT_GE(truth.map.keyframes.size(), 3U);
  TrackingMap map = truth.map;
  DisturbVelocities(map);
  const double before = FlowError(map, truth.map);
  RefineVelocities(truth.stated, options.sensor, Options(), map);
  EXPECT_LT(FlowError(map, truth.map), 0.7 * before);
}

TEST(RefineVelocities, PosesThatAreOffDoNotSpoilThem) {
  const TrueMap truth = MakeTrueMap(WithReadout());
  TrackingMap map = truth.map;
  DisturbVelocities(map);
  const double before = FlowError(map, truth.map);
  for (MapKeyframe& keyframe : map.keyframes) {
    Vector6d twist;
    twist << 0.002, -0.001, 0.001, 0.001, 0.002, -0.001;
    keyframe.T_world_color = keyframe.T_world_color * PoseFromTwist(twist);
  }
  RefineVelocities(truth.stated, WithReadout().sensor, Options(), map);
  EXPECT_LT(FlowError(map, truth.map), 0.4 * before);
}

TEST(RefineVelocities, ThePriorActs) {
  const TrueMap truth = MakeTrueMap(WithReadout());
  TrackingMap map = truth.map;
  DisturbVelocities(map);
  const TrackingMap disturbed = map;
  VelocityOptions sure = Options();
  sure.turning_sigma_rad_per_s = sure.shifting_sigma_m_per_s = 1e-6;
  RefineVelocities(truth.stated, WithReadout().sensor, sure, map);
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    EXPECT_LT((map.keyframes[k].velocity_per_s - disturbed.keyframes[k].velocity_per_s).norm(),
              1e-4);
}

TEST(RefineVelocities, MovesNothingElseAndNothingThatTheImageDoesNotShow) {
  const TrueMap truth = MakeTrueMap(WithReadout());
  TrackingMap map = truth.map;
  DisturbVelocities(map);
  map.keyframes[2].keypoints.clear();
  map.keyframes[2].data.markers.clear();
  const TrackingMap disturbed = map;
  RefineVelocities(truth.stated, WithReadout().sensor, Options(), map);
  EXPECT_EQ(map.keyframes[2].velocity_per_s, disturbed.keyframes[2].velocity_per_s);
  EXPECT_NE(map.keyframes[3].velocity_per_s, disturbed.keyframes[3].velocity_per_s);
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    EXPECT_EQ(map.keyframes[k].T_world_color.matrix(),
              disturbed.keyframes[k].T_world_color.matrix());
  EXPECT_EQ(map.landmarks[0].p_world, disturbed.landmarks[0].p_world);
  // All rows at once show no motion.
  TrackingMap at_once = disturbed;
  RefineVelocities(truth.stated, CalibrationModel{}, Options(), at_once);
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    EXPECT_LT((at_once.keyframes[k].velocity_per_s - disturbed.keyframes[k].velocity_per_s).norm(),
              1e-9);
}

}  // namespace
}  // namespace plumb
