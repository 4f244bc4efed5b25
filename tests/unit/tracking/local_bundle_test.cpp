#include "algo/tracking/local_bundle.hpp"

#include <cstring>
#include <numeric>
#include <stdexcept>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "algo/tracking/bundle_adjustment.hpp"
#include "tests/unit/tracking/synthetic_map.hpp"

namespace plumb {
namespace {

using synthetic::Compare;
using synthetic::Disturb;
using synthetic::MakeTrueMap;
using synthetic::WithKeypointDepthsOff;

LocalBundleOptions FreeFrom(int first, const TrackingMap& map) {
  LocalBundleOptions options;
  options.free_keyframes.resize(map.keyframes.size() - static_cast<std::size_t>(first));
  std::iota(options.free_keyframes.begin(), options.free_keyframes.end(), first);
  options.marker_length_m = synthetic::kMarkerLength;
  options.max_iterations = 20;
  options.min_relative_decrease = 0.0;
  return options;
}

TEST(LocalBundle, RefusesMarkersWhoseLengthWasNeverSet) {
  const auto truth = MakeTrueMap({.num_keyframes = 3, .num_landmarks = 40});
  TrackingMap map = truth.map;
  LocalBundleOptions options = FreeFrom(1, map);
  options.marker_length_m = LocalBundleOptions().marker_length_m;
  EXPECT_THROW(AdjustLocalMap(truth.stated, options, map), std::invalid_argument);
}

TEST(LocalBundle, FindsDisturbedPosesLandmarksAndMarkers) {
  const auto truth = MakeTrueMap({});
  TrackingMap map = truth.map;
  Disturb(map, 0.01, 0.01);
  const LocalBundleSummary summary = AdjustLocalMap(truth.stated, FreeFrom(1, map), map);
  const auto error = Compare(map, truth.map);
  fmt::print("poses {:.2e} m {:.2e} rad, cost {:.3g} -> {:.3g} in {} iterations\n",
             error.translation_m, error.rotation_rad, summary.initial_cost, summary.final_cost,
             summary.num_iterations);
  // Measured: 0.025 mm and 0.016 mrad, what the depth stamp's motion to first order leaves (the
  // other solver stops there too).
  EXPECT_LT(error.translation_m, 5e-5);
  EXPECT_LT(error.rotation_rad, 5e-5);
  for (const auto& [id, marker] : map.markers)
    EXPECT_LT((marker.T_world_marker.translation() -
               truth.map.markers.at(id).T_world_marker.translation())
                  .norm(),
              5e-5)
        << "marker " << id;
}

// Wrong derivatives still creep downhill; true ones converge quadratically once the damping is
// gone.
TEST(LocalBundle, ConvergesInAFewIterations) {
  const auto truth = MakeTrueMap({});
  TrackingMap map = truth.map;
  Disturb(map, 0.01, 0.01);
  TrackingMap longer = map;
  LocalBundleOptions options = FreeFrom(1, map);
  AdjustLocalMap(truth.stated, options, longer);
  options.max_iterations = 6;
  AdjustLocalMap(truth.stated, options, map);
  const double left_m = Compare(map, longer).translation_m;
  fmt::print("after 6 of 20 iterations: {:.2e} m left\n", left_m);
  EXPECT_LT(left_m, 1e-8);  // Measured: 5e-13.
}

TEST(LocalBundle, FindsPosesByMarkersAlone) {
  const auto truth = MakeTrueMap({.num_landmarks = 0});
  TrackingMap map = truth.map;
  Disturb(map, 0.005, 0.005);
  AdjustLocalMap(truth.stated, FreeFrom(1, map), map);
  // Keyframes that see no marker keep their disturbance; all of the others must be found.
  for (std::size_t k = 1; k < map.keyframes.size(); ++k) {
    if (map.keyframes[k].data.markers.size() < 2) continue;
    const Pose T = truth.map.keyframes[k].T_world_color.inverse() * map.keyframes[k].T_world_color;
    EXPECT_LT(T.translation().norm(), 1e-5) << "keyframe " << k;
  }
}

TEST(LocalBundle, LeavesTheOtherKeyframesAlone) {
  const auto truth = MakeTrueMap({.pixel_noise = 0.5});
  TrackingMap map = truth.map;
  Disturb(map, 0.003, 0.003);
  const TrackingMap before = map;
  AdjustLocalMap(truth.stated, FreeFrom(6, map), map);
  for (std::size_t k = 0; k < 6; ++k)
    EXPECT_TRUE(map.keyframes[k].T_world_color.isApprox(before.keyframes[k].T_world_color, 0.0))
        << "keyframe " << k;
  for (std::size_t k = 6; k < map.keyframes.size(); ++k)
    EXPECT_FALSE(map.keyframes[k].T_world_color.isApprox(before.keyframes[k].T_world_color, 1e-9))
        << "keyframe " << k;
}

// The whole map's solver shares nothing with this one but the model. Where this one stops, that one
// must find next to nothing left.
TEST(LocalBundle, StopsWhereTheWholeMapsSolverStopsToo) {
  const auto truth = MakeTrueMap({.pixel_noise = 0.4, .depth_noise_sigmas = 1.0});
  TrackingMap map = truth.map;
  Disturb(map, 0.005, 0.005);
  const LocalBundleOptions local = FreeFrom(1, map);
  AdjustLocalMap(truth.stated, local, map);
  TrackingMap again = map;
  BundleOptions whole;
  whole.free_keyframes = local.free_keyframes;
  whole.marker_length_m = local.marker_length_m;
  whole.min_corner_sigma_px = local.min_corner_sigma_px;
  whole.max_iterations = 20;
  CalibrationModel none;
  const BundleSummary summary = BundleAdjust(truth.stated, whole, {}, again, none);
  const auto moved = Compare(again, map);
  fmt::print("left for the other solver: cost {:.6g} -> {:.6g}, {:.2e} m, {:.2e} rad\n",
             summary.initial_cost, summary.final_cost, moved.translation_m, moved.rotation_rad);
  EXPECT_LT(summary.initial_cost - summary.final_cost, 1e-3 * summary.initial_cost);
  EXPECT_LT(moved.translation_m, 2e-4);
  EXPECT_LT(moved.rotation_rad, 2e-4);
}

TEST(LocalBundle, WrongObservationsWeighLittle) {
  const auto truth = MakeTrueMap({});
  TrackingMap map = truth.map;
  for (MapKeyframe& keyframe : map.keyframes)
    for (std::size_t i = 0; i < keyframe.keypoints.size(); i += 10)
      keyframe.keypoints[i].pixel.x() += 25.0;
  Disturb(map, 0.003, 0.003);
  AdjustLocalMap(truth.stated, FreeFrom(1, map), map);
  const auto error = Compare(map, truth.map);
  fmt::print("with 10 % wrong by 25 px: {:.2e} m {:.2e} rad\n", error.translation_m,
             error.rotation_rad);
  EXPECT_LT(error.translation_m, 1e-3);
}

TEST(LocalBundle, SameBitsTwice) {
  const auto truth = MakeTrueMap({.pixel_noise = 0.4});
  TrackingMap a = truth.map;
  Disturb(a, 0.005, 0.005);
  TrackingMap b = a;
  AdjustLocalMap(truth.stated, FreeFrom(1, a), a);
  AdjustLocalMap(truth.stated, FreeFrom(1, b), b);
  for (std::size_t k = 0; k < a.keyframes.size(); ++k)
    EXPECT_EQ(std::memcmp(a.keyframes[k].T_world_color.data(), b.keyframes[k].T_world_color.data(),
                          16 * sizeof(double)),
              0);
}

TEST(LocalBundle, LeavesAMapThatShowsNothingAsItIs) {
  TrackingMap map;
  map.keyframes.resize(2);
  map.keyframes[1].T_world_color.translation().x() = 0.1;
  const LocalBundleSummary summary =
      AdjustLocalMap(MakeTrueMap({.num_landmarks = 1}).stated,
                     {.free_keyframes = {1}, .marker_length_m = synthetic::kMarkerLength}, map);
  EXPECT_EQ(summary.num_observations, 0);
  EXPECT_DOUBLE_EQ(map.keyframes[1].T_world_color.translation().x(), 0.1);
}

TEST(LocalBundle, DepthCostsByTheNoiseThatIsStatedForIt) {
  const auto truth = MakeTrueMap({.markers = false});
  const auto cost = [&](double constant_m) {
    TrackingMap map = WithKeypointDepthsOff(truth.map, 0.02);
    LocalBundleOptions options = FreeFrom(1, map);
    options.depth_noise.constant_m = constant_m;
    options.max_iterations = 1;
    return AdjustLocalMap(truth.stated, options, map).initial_cost;
  };
  EXPECT_LT(cost(0.1), 0.05 * cost(0.001));
  EXPECT_EQ(cost(DepthNoise().constant_m), cost(0.0012));
}

}  // namespace
}  // namespace plumb
