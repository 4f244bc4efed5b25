// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/joint_registration.hpp"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "algo/base/errors.hpp"
#include "tests/unit/tracking/synthetic_map.hpp"

namespace plumb {
namespace {

using synthetic::Compare;
using synthetic::Disturb;
using synthetic::MakeTrueMap;
using synthetic::TrueMap;

constexpr synthetic::MapOptions kLandscape{.num_keyframes = 8,
                                           .num_landmarks = 120,
                                           .dense = true,
                                           .pixel_noise = 0.1,
                                           .image_noise_m = 0.001};

JointRegistrationOptions OfTheRoom() { return {.marker_length_m = synthetic::kMarkerLength}; }

TEST(RegisterJointly, RefusesMarkersWhoseLengthWasNeverSet) {
  const TrueMap truth = MakeTrueMap({.num_keyframes = 3, .num_landmarks = 40});
  TrackingMap map = truth.map;
  EXPECT_THROW((void)RegisterJointly(truth.stated, {}, map), std::invalid_argument);
}

TEST(RegisterJointly, FindsDisturbedPosesByDenseDepth) {
  const TrueMap truth = MakeTrueMap(kLandscape);
  TrackingMap map = truth.map;
  Disturb(map, 0.006, 0.006);
  const double before = Compare(map, truth.map).translation_m;
  const auto result = RegisterJointly(truth.stated, OfTheRoom(), map);
  const auto error = Compare(map, truth.map);
  fmt::print("{:.2e} -> {:.2e} m, {:.2e} rad, consistency {:.2e} -> {:.2e} m, {} pairs\n", before,
             error.translation_m, error.rotation_rad, result.consistency_before_m,
             result.consistency_after_m, result.num_pairs);
  EXPECT_GT(result.num_pairs, 6);
  EXPECT_LE(result.consistency_after_m, result.consistency_before_m);
  EXPECT_TRUE(result.accepted);
  EXPECT_LT(error.translation_m, 0.0025);  // Measured: 1.2 mm, of 8.4 mm before.
  EXPECT_LT(error.rotation_rad, 0.003);    // Measured: 1.4 mrad.
}

TEST(RegisterJointly, KeepsAKeyframeThatSawNextToNothingWhereTrackingPutIt) {
  // A blank wall: no depth, four keypoints, and those are taken for others.
  const auto error_m = [](bool tracked) {
    TrueMap truth = MakeTrueMap(
        {.num_keyframes = 8, .num_landmarks = 120, .markers = false, .pixel_noise = 0.1});
    constexpr std::size_t kBlank = 4;
    MapKeyframe& blank = truth.map.keyframes[kBlank];
    blank.keypoints.resize(4);
    for (KeypointObservation& o : blank.keypoints)
      o = {o.landmark, o.pixel + Eigen::Vector2d(15, -10), 0.0};
    if (tracked) {
      blank.previous = kBlank - 1;
      blank.T_previous_color =
          truth.map.keyframes[kBlank - 1].T_world_color.inverse() * blank.T_world_color;
    }
    TrackingMap map = truth.map;
    (void)RegisterJointly(truth.stated,
                          {.marker_length_m = synthetic::kMarkerLength, .use_dense = false}, map);
    return (map.keyframes[kBlank].T_world_color.translation() - blank.T_world_color.translation())
        .norm();
  };
  const double tracked_m = error_m(true), alone_m = error_m(false);
  fmt::print("with tracking's word {:.2e} m, without {:.2e} m\n", tracked_m, alone_m);
  EXPECT_LT(tracked_m, 0.015);  // Measured: 11 and 59 mm.
  EXPECT_GT(alone_m, 2 * tracked_m) << "nothing pulls: nothing is tested";
}

TEST(RegisterJointly, FindsWhatTheDepthCameraGetsWrong) {
  synthetic::MapOptions options = kLandscape;
  options.sensor.depth[0] = 0.008;
  options.sensor.depth[3] = 1.5;
  options.sensor.depth[5] = 0.004;
  const TrueMap truth = MakeTrueMap(options);
  TrackingMap map = truth.map;
  const auto result = RegisterJointly(truth.stated, OfTheRoom(), map);
  const auto& d = result.calibration.depth;
  // Scale and offset stand in for each other within one range of depths: what they do at the
  // working distance counts.
  const double at_working_distance = result.calibration.CorrectedDepth(0.9, {0, 0}) - 0.9;
  fmt::print("depth +{:.4f} m of {:.4f}, shift {:.2f} px of 1.50, delay {:.4f} s of 0.0040\n",
             at_working_distance, 0.9 * 0.008, d[3], d[5]);
  EXPECT_NEAR(at_working_distance, 0.9 * 0.008, 0.001);  // Measured: within 0.05 mm.
  EXPECT_NEAR(d[3], 1.5, 0.4);                           // Measured: 1.63.
  EXPECT_NEAR(d[5], 0.004, 0.001);                       // Measured: 0.0041.
}

TEST(RegisterJointly, BeginsFromWhatIsKnownOfTheSensorAndSaysWhatTheSweepShowed) {
  synthetic::MapOptions options = kLandscape;
  options.sensor.depth[kDepthScale] = 0.008;
  const TrueMap truth = MakeTrueMap(options);
  JointRegistrationOptions known = OfTheRoom();
  known.prior.mean[kDepthAt + kDepthScale] = 0.004;
  known.prior.information(kDepthAt + kDepthScale, kDepthAt + kDepthScale) = 1e16;
  TrackingMap map = truth.map;
  const auto held = RegisterJointly(truth.stated, known, map);
  EXPECT_NEAR(held.calibration.depth[kDepthScale], 0.004, 1e-5) << "the prior does not act";
  TrackingMap again = truth.map;
  const auto free = RegisterJointly(truth.stated, OfTheRoom(), again);
  ASSERT_TRUE(free.accepted);
  EXPECT_EQ(free.evidence.solution, ToVector(free.calibration));
  const auto& information = free.evidence.information;
  EXPECT_TRUE(information.isApprox(information.transpose()));
  EXPECT_GT(information(kLensAt, kLensAt), 1e4);  // A focal length to better than one percent.
  EXPECT_GT(information(kDepthAt + kDepthShiftX, kDepthAt + kDepthShiftX), 1.0);
}

TEST(RegisterJointly, AsksForVelocitiesBeforeEachRound) {
  const TrueMap truth = MakeTrueMap({.num_keyframes = 5, .num_landmarks = 60, .dense = true});
  TrackingMap map = truth.map;
  int asked = 0;
  JointRegistrationOptions options = OfTheRoom();
  options.num_rounds = 2;
  options.num_velocity_rounds = 3;
  options.settled_m = 0.0;
  options.refresh_velocities = [&](TrackingMap& moved) {
    EXPECT_EQ(&moved, &map);
    ++asked;
  };
  static_cast<void>(RegisterJointly(truth.stated, options, map));
  EXPECT_EQ(asked, 5);
}

TEST(RegisterJointly, FindsVelocitiesInTheRowsUnlessToldNotTo) {
  synthetic::MapOptions with_readout{.num_keyframes = 6, .num_landmarks = 120};
  with_readout.sensor.readout_s[0] = 0.025;
  const TrueMap truth = MakeTrueMap(with_readout);
  JointRegistrationOptions options = OfTheRoom();
  options.use_dense = false;
  options.refresh_velocities = [&](TrackingMap& moved) {
    for (std::size_t k = 0; k < moved.keyframes.size(); ++k) {
      moved.keyframes[k].velocity_per_s = truth.map.keyframes[k].velocity_per_s;
      moved.keyframes[k].velocity_per_s[2] += 0.05;  // Only the rows can know better.
    }
  };
  const auto error = [&](bool use_row_motion) {
    options.use_row_motion = use_row_motion;
    TrackingMap map = truth.map;
    static_cast<void>(RegisterJointly(truth.stated, options, map));
    double sum = 0;
    for (std::size_t k = 0; k < map.keyframes.size(); ++k)
      sum +=
          std::abs(map.keyframes[k].velocity_per_s[2] - truth.map.keyframes[k].velocity_per_s[2]);
    return sum / static_cast<double>(map.keyframes.size());
  };
  EXPECT_NEAR(error(false), 0.05, 1e-12);
  EXPECT_LT(error(true), 0.035);
}

TEST(RegisterJointly, SameBitsOnAnyNumberOfThreads) {
  const TrueMap truth = MakeTrueMap({.num_keyframes = 5, .num_landmarks = 60, .dense = true});
  std::vector<TrackingMap> maps(2, truth.map);
  std::vector<CalibrationModel> calibrations;
  for (std::size_t i = 0; i < 2; ++i) {
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, i + 1);
    Disturb(maps[i], 0.004, 0.004);
    calibrations.push_back(
        RegisterJointly(truth.stated,
                        {.marker_length_m = synthetic::kMarkerLength, .num_rounds = 2}, maps[i])
            .calibration);
  }
  EXPECT_EQ(calibrations[0].depth, calibrations[1].depth);
  EXPECT_EQ(calibrations[0].lens, calibrations[1].lens);
  for (std::size_t k = 0; k < maps[0].keyframes.size(); ++k)
    EXPECT_EQ(maps[0].keyframes[k].T_world_color.matrix(),
              maps[1].keyframes[k].T_world_color.matrix());
}

TEST(RegisterJointly, TheFirstKeyframeIsTheGauge) {
  const TrueMap truth = MakeTrueMap({.num_keyframes = 4, .num_landmarks = 60, .dense = true});
  TrackingMap map = truth.map;
  Disturb(map, 0.004, 0.004);
  static_cast<void>(RegisterJointly(
      truth.stated, {.marker_length_m = synthetic::kMarkerLength, .num_rounds = 1}, map));
  EXPECT_EQ(map.keyframes[0].T_world_color.matrix(), truth.map.keyframes[0].T_world_color.matrix());
}

TEST(RegisterJointly, StatesTheUncertaintyOfMarkersWithAndWithoutDepthAndFromOneKeyframe) {
  const TrueMap truth = MakeTrueMap(kLandscape);
  const auto sigmas = [&](bool use_dense, bool calibrate, std::size_t num_keyframes) {
    TrackingMap map = truth.map;
    map.keyframes.resize(num_keyframes);
    JointRegistrationOptions options = OfTheRoom();
    options.use_dense = use_dense;
    options.calibrate = calibrate;
    const JointRegistrationResult result = RegisterJointly(truth.stated, options, map);
    EXPECT_EQ(result.accepted, use_dense && num_keyframes > 1);
    return result.marker_sigmas_m;
  };
  const auto dense = sigmas(true, true, 8);
  const auto sparse = sigmas(false, true, 8);
  ASSERT_EQ(dense.size(), truth.map.markers.size());
  ASSERT_EQ(sparse.size(), truth.map.markers.size());
  EXPECT_EQ(sigmas(true, false, 8).size(), truth.map.markers.size());
  for (const auto& [id, sigma] : dense) {
    EXPECT_GT(sigma, 1e-5) << id;
    EXPECT_LT(sigma, 0.005) << id;
  }
  const auto one = sigmas(true, true, 1);
  ASSERT_FALSE(one.empty());
  for (const auto& [id, sigma] : one) {
    EXPECT_GT(sigma, dense.at(id)) << id;
    EXPECT_GT(sigma, sparse.at(id)) << id;
  }
}

TEST(RegisterJointly, StopsOnRequestAndLeavesTinyMapsAlone) {
  const TrueMap truth = MakeTrueMap({.num_keyframes = 3, .num_landmarks = 40, .dense = true});
  TrackingMap map = truth.map;
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(static_cast<void>(RegisterJointly(truth.stated, OfTheRoom(), map, stop.get_token())),
               Interrupted);
  TrackingMap one;
  one.keyframes.resize(1);
  EXPECT_FALSE(RegisterJointly(truth.stated, OfTheRoom(), one).accepted);
  TrackingMap none;
  EXPECT_EQ(RegisterJointly(truth.stated, OfTheRoom(), none).num_pairs, 0);
}

}  // namespace
}  // namespace plumb
