// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/marker_uncertainty.hpp"

#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/sensor_model/depth_noise.hpp"
#include "tests/unit/tracking/synthetic_map.hpp"

namespace plumb {
namespace {

constexpr double kLength_m = 0.104;
// By how much the stated sigmas exceed those of the covariance.
constexpr double kErrorByPosterior = 1.6;

// Markers around a body.
TrackingMap MapOf(int count) {
  TrackingMap map;
  for (int id = 0; id < count; ++id) {
    const double angle = 6.283 * id / count;
    map.markers[id].T_world_marker =
        Pose(Eigen::Translation3d(3 + 0.7 * std::cos(angle), 0.5 * std::sin(angle), 0.05 * id) *
             Eigen::AngleAxisd(1.1 * id, Eigen::Vector3d(0.2, 0.1, 1).normalized()));
  }
  return map;
}

// The marker's corners err on their own, by this much in each coordinate (root mean square), in
// shifts and turns alike as far as a rigid square can.
void SetOwnError(int id, double sigma_m, BundlePosterior& posterior) {
  const double h = kLength_m / 2;
  Vector6d per_twist;  // Squares over the coordinates of the four corners.
  per_twist << 4 * h * h, 4 * h * h, 8 * h * h, 4, 4, 4;
  const Eigen::Index row = posterior.marker_rows.at(id);
  posterior.of_markers.diagonal().segment<6>(row) =
      12.0 / 6.0 * sigma_m * sigma_m * per_twist.cwiseInverse();
}

BundlePosterior Uncertain(const TrackingMap& map, double sigma_m) {
  BundlePosterior posterior;
  const auto size = 6 * static_cast<Eigen::Index>(map.markers.size());
  posterior.of_markers = Eigen::MatrixXd::Zero(size, size);
  Eigen::Index row = 0;
  for (const auto& [id, marker] : map.markers) {
    posterior.marker_rows[id] = row;
    SetOwnError(id, sigma_m, posterior);
    row += 6;
  }
  return posterior;
}

// Adds the covariance of a motion that all markers make together.
void AddCommonMotion(const TrackingMap& map, double rotation_rad, double shift_m,
                     BundlePosterior& posterior) {
  Eigen::MatrixXd common(posterior.of_markers.rows(), 6);
  for (const auto& [id, marker] : map.markers) {
    const Eigen::Matrix3d R = marker.T_world_marker.linear().transpose();
    const Eigen::Index row = posterior.marker_rows.at(id);
    common.block<6, 6>(row, 0) << R, Eigen::Matrix3d::Zero(),
        -R * Skew(marker.T_world_marker.translation()), R;
  }
  common.leftCols<3>() *= rotation_rad;
  common.rightCols<3>() *= shift_m;
  posterior.of_markers += common * common.transpose();
}

TEST(MarkerUncertaintyTest, StatesTheErrorOfEachMarkerAlone) {
  for (const int count : {3, 12}) {
    const TrackingMap map = MapOf(count);
    const auto sigmas = MarkerSigmas(Uncertain(map, 0.001), map, kLength_m);
    ASSERT_EQ(sigmas.size(), static_cast<std::size_t>(count));
    // Of three markers the fit takes a third of the variance, which must come back.
    for (const auto& [id, sigma] : sigmas)
      EXPECT_NEAR(sigma / kErrorByPosterior, 0.001, 5e-5) << id;
  }
}

TEST(MarkerUncertaintyTest, WhatAllMarkersShareIsNotInIt) {
  const TrackingMap map = MapOf(8);
  BundlePosterior posterior = Uncertain(map, 0.0003);
  const auto alone = MarkerSigmas(posterior, map, kLength_m);
  AddCommonMotion(map, 0.003, 0.004, posterior);
  const auto together = MarkerSigmas(posterior, map, kLength_m);
  for (const auto& [id, sigma] : alone) EXPECT_NEAR(together.at(id), sigma, 1e-9) << id;
  // One marker has no others to share it with.
  const TrackingMap single = MapOf(1);
  posterior = Uncertain(single, 0.0003);
  EXPECT_NEAR(MarkerSigmas(posterior, single, kLength_m).at(0), kErrorByPosterior * 0.0003, 1e-9);
  AddCommonMotion(single, 0, 0.0004, posterior);
  EXPECT_NEAR(MarkerSigmas(posterior, single, kLength_m).at(0), kErrorByPosterior * 0.0005, 1e-9);
}

TEST(MarkerUncertaintyTest, APoorlyDeterminedMarkerDoesNotSpoilTheOthers) {
  const TrackingMap map = MapOf(8);
  BundlePosterior posterior = Uncertain(map, 0.0003);
  SetOwnError(5, 0.01, posterior);
  for (const auto& [id, sigma] : MarkerSigmas(posterior, map, kLength_m)) {
    if (id == 5) {
      EXPECT_NEAR(sigma / kErrorByPosterior, 0.01, 0.001);
    } else {
      // An unweighted fit would turn and shift the others by millimetres.
      EXPECT_NEAR(sigma / kErrorByPosterior, 0.0003, 3e-5) << id;
    }
  }
}

TEST(MarkerUncertaintyTest, AMarkerThatNothingDeterminesHasNone) {
  const TrackingMap map = MapOf(8);
  BundlePosterior posterior = Uncertain(map, 0.0003);
  const auto set = [&](double sigma_m) {
    posterior.of_markers.diagonal()
        .segment<3>(posterior.marker_rows.at(5) + 3)
        .setConstant(sigma_m * sigma_m);
    return MarkerSigmas(posterior, map, kLength_m);
  };
  EXPECT_EQ(set(0.099).size(), 8U);
  EXPECT_EQ(set(0.101).size(), 7U);
  const auto without = set(3e4);  // The solve's own damping is all that holds it.
  EXPECT_FALSE(without.contains(5));
  for (const auto& [id, sigma] : without)
    EXPECT_NEAR(sigma / kErrorByPosterior, 0.0003, 3e-5) << id;
  EXPECT_THAT(MarkerSigmas({}, map, kLength_m), ::testing::IsEmpty());
}

// The covariance itself: how far markers lie from the truth in repeated sweeps, whose observations
// err as the solve assumes.
TEST(MarkerUncertaintyTest, MarkersScatterAsThePosteriorStates) {
  const auto truth = synthetic::MakeTrueMap({.num_keyframes = 6, .num_landmarks = 60});
  BundleOptions options;
  options.free_keyframes.resize(truth.map.keyframes.size() - 1);
  std::iota(options.free_keyframes.begin(), options.free_keyframes.end(), 1);
  options.marker_length_m = synthetic::kMarkerLength;
  options.find_information = true;
  const double scale = truth.stated.width / 640.0;
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const auto noise = [&](double sigma) {
    return Eigen::Vector2d(sigma * normal(random), sigma * normal(random));
  };
  double sum = 0;
  int count = 0;
  for (int sweep = 0; sweep < 40; ++sweep) {
    TrackingMap map = truth.map;
    for (MapKeyframe& keyframe : map.keyframes) {
      for (MarkerObservation& marker : keyframe.data.markers) {
        for (std::size_t i = 0; i < 4; ++i) {
          marker.sigma_px.at(i) = 0.1;
          marker.corners.at(i) += noise(0.1);
        }
      }
      for (KeypointObservation& o : keyframe.keypoints) {
        o.pixel += noise(options.keypoint_sigma_px * scale);
        o.z_m += options.keypoint_depth_sigmas * DepthSigma(options.depth_noise, o.z_m, 0.8) *
                 normal(random);
      }
    }
    CalibrationModel calibration;
    const BundleSummary summary = BundleAdjust(truth.stated, options, {}, map, calibration);
    EXPECT_EQ(summary.posterior.with_calibration.rows(), 0) << "it was not free";
    ASSERT_EQ(summary.posterior.of_markers.rows(),
              6 * static_cast<Eigen::Index>(summary.posterior.marker_rows.size()));
    Eigen::VectorXd error(summary.posterior.of_markers.rows());
    Eigen::Index at = 0;
    for (const auto& [id, row] : summary.posterior.marker_rows) {
      error.segment<6>(at) = TwistFromPose(truth.map.markers.at(id).T_world_marker.inverse() *
                                           map.markers.at(id).T_world_marker);
      at += 6;
    }
    sum += error.dot(summary.posterior.of_markers.ldlt().solve(error));
    count += static_cast<int>(error.size());
  }
  std::printf("normalised error %.3f (RMS)\n", std::sqrt(sum / count));
  EXPECT_NEAR(std::sqrt(sum / count), 1.0, 0.1);
}

}  // namespace
}  // namespace plumb
