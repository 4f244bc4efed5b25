// SPDX-License-Identifier: Apache-2.0
// The derivatives that bundle adjustment uses, against differences of the values.
#include "algo/bundle/bundle_model.hpp"

#include <cmath>
#include <functional>
#include <utility>

#include <gtest/gtest.h>

#include "tests/unit/bundle/derivatives.hpp"

namespace plumb::bundle {
namespace {

CameraState SomeCamera() {
  CameraState camera;
  camera.T_camera0_world = PoseFromTwist((Vector6d() << 0.3, -0.2, 0.5, 0.1, -0.4, 0.8).finished());
  camera.velocity_per_s << 0.4, -0.3, 0.2, 0.25, -0.1, 0.3;
  camera.twist << 0.02, -0.01, 0.015, 0.03, 0.02, -0.01;
  camera.Prepare();
  return camera;
}

Intrinsics SomeLens() {
  return {320, 240, 262.0, 263.0, 158.0, 121.0, {0.06, -0.15, 0.001, -0.0008, 0.03}};
}

Intrinsics RationalLens() {
  Intrinsics lens = SomeLens();
  lens.distortion = {0.51, -2.74, 0.0006, -0.0002, 1.64, 0.39, -2.55, 1.56};
  return lens;
}

const Eigen::Vector3d kPoint(0.2, 0.35, 0.9);
constexpr double kLate_s = 0.02;

TEST(BundleModel, PoseDerivativeOfASeenPoint) {
  const double worst =
      Mismatch<3, 6>(See(SomeCamera(), kPoint, kLate_s).J_pose, [](const Vector6d& step) {
        CameraState camera = SomeCamera();
        camera.twist += step;
        camera.Prepare();
        return See(camera, kPoint, kLate_s).p;
      });
  EXPECT_LT(worst, 1e-5);  // The right Jacobian is of second order: w^3 / 24 is 1e-6 here.
}

TEST(BundleModel, WorldAndTimeDerivativesOfASeenPoint) {
  const SeenPoint seen = See(SomeCamera(), kPoint, kLate_s);
  EXPECT_LT((Mismatch<3, 3>(seen.J_world,
                            [](const Eigen::Vector3d& step) {
                              return See(SomeCamera(), kPoint + step, kLate_s).p;
                            })),
            1e-8);
  EXPECT_LT((Mismatch<3, 1>(seen.J_time,
                            [](const Eigen::Matrix<double, 1, 1>& step) {
                              return See(SomeCamera(), kPoint, kLate_s + step[0]).p;
                            })),
            1e-8);
}

TEST(BundleModel, ASeenPointMovesAsTheCameraDoes) {
  // Exactly, by the pose itself some time later; what differs is of second order in that time.
  const CameraState camera = SomeCamera();
  const Eigen::Vector3d exact =
      (camera.T_camera_world.inverse() * PoseFromTwist(camera.velocity_per_s * kLate_s)).inverse() *
      kPoint;
  EXPECT_LT((See(camera, kPoint, kLate_s).p - exact).norm(), 2e-4);
  EXPECT_GT((See(camera, kPoint, 0.0).p - exact).norm(), 2e-3);
}

void CheckDerivativesOfAPixel(const Intrinsics& camera) {
  constexpr int kSize = CalibrationModel::kLensSize;
  const CalibrationModel::Lens lens = {0.002, -0.001, 0.5, -0.7, 0.01, -0.02, 0.003, -0.002};
  const Eigen::Vector3d p(0.31, -0.22, 0.8);
  const SeenPixel seen = ProjectCorrected(camera, lens, p);
  EXPECT_LT((Mismatch<2, 3>(seen.J_point,
                            [&](const Eigen::Vector3d& step) {
                              return ProjectCorrected(camera, lens, p + step).pixel;
                            })),
            1e-5);
  const double worst =
      Mismatch<2, kSize>(seen.J_lens, [&](const Eigen::Matrix<double, kSize, 1>& step) {
        CalibrationModel::Lens moved = lens;
        for (int i = 0; i < kSize; ++i) moved[static_cast<std::size_t>(i)] += step[i];
        return ProjectCorrected(camera, moved, p).pixel;
      });
  EXPECT_LT(worst, 1e-5);
  // Without corrections it is the stated lens.
  EXPECT_LT((ProjectCorrected(camera, {}, p).pixel - Project(camera, p)).norm(), 1e-9);
}

TEST(BundleModel, DerivativesOfAPixel) {
  CheckDerivativesOfAPixel(SomeLens());
  CheckDerivativesOfAPixel(RationalLens());
}

TEST(BundleModel, AShutterReadsLinesAlongTheLongSide) {
  Intrinsics camera;
  camera.width = 640;
  camera.height = 480;
  EXPECT_DOUBLE_EQ(ReadoutFraction({100, -0.5}, camera), -0.5);
  EXPECT_DOUBLE_EQ(ReadoutFraction({100, 479.5}, camera), 0.5);
  std::swap(camera.width, camera.height);
  EXPECT_DOUBLE_EQ(ReadoutFraction({-0.5, 100}, camera), -0.5);
  EXPECT_DOUBLE_EQ(ReadoutFraction({479.5, 100}, camera), 0.5);
}

TEST(BundleModel, DerivativesOfAPredictedDepth) {
  constexpr int kSize = CalibrationModel::kDepthSize;
  CalibrationModel calibration;
  calibration.depth = {0.01, 0.004, -0.003, 0.4, -0.3, 0.003, 0.002, -0.0015, 0.02};
  for (int i = kDepthField; i < kSize; ++i)
    calibration.depth[static_cast<std::size_t>(i)] = 0.001 * std::sin(i);
  const DepthPlace place({255.5, 55.5}, SomeLens());
  const auto predict = [&](const CalibrationModel& c) {
    return PredictDepth(c,
                        See(SomeCamera(), kPoint,
                            c.depth[kDepthDelay] + place.row_fraction * c.depth[kDepthReadout]),
                        place);
  };
  const PredictedDepth predicted = predict(calibration);
  const double worst =
      Mismatch<1, kSize>(predicted.J_depth, [&](const Eigen::Matrix<double, kSize, 1>& step) {
        CalibrationModel moved = calibration;
        for (int i = 0; i < kSize; ++i) moved.depth[static_cast<std::size_t>(i)] += step[i];
        return Eigen::Matrix<double, 1, 1>(predict(moved).z_m);
      });
  EXPECT_LT(worst, 1e-7);
  // The model also predicts what it corrects, except for the growth's change between the true and
  // the measured depth: measured -> corrected -> measured.
  const SeenPoint seen = See(SomeCamera(), kPoint, 0.0);
  const double raw_m = PredictDepth(calibration, seen, place).z_m;
  EXPECT_NEAR(calibration.CorrectedDepth(raw_m, place.centred), seen.p.z(), 1e-4);
  EXPECT_DOUBLE_EQ(PredictDepthOnly(calibration, seen.p.z(), place), raw_m);
}

TEST(BundleModel, ADepthReadingBesideThePixelLiesOnThePlane) {
  // 1/z = 1.25 + 0.02 dx - 0.01 dy.
  const DepthReading reading{0.8, {0.02, -0.01}};
  EXPECT_DOUBLE_EQ(DepthBeside(reading, {0.0, 0.0}).z_m, 0.8);
  const DepthBeside beside(reading, {1.5, -2.0});
  EXPECT_DOUBLE_EQ(beside.z_m, 1.0 / 1.30);
  const double worst = Mismatch<1, 2>(beside.J_offset, [&](const Eigen::Vector2d& step) {
    return Eigen::Matrix<double, 1, 1>(DepthBeside(reading, Eigen::Vector2d(1.5, -2.0) + step).z_m);
  });
  EXPECT_LT(worst, 1e-6);
  // A plane that would reach infinity is not followed that far.
  EXPECT_DOUBLE_EQ(DepthBeside(reading, {-60.0, 40.0}).z_m, 1.6);
}

}  // namespace
}  // namespace plumb::bundle
