// SPDX-License-Identifier: Apache-2.0
#include "algo/bundle/keypoint_term.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/unit/bundle/derivatives.hpp"
#include "tests/unit/bundle/term_inputs.hpp"

namespace plumb::bundle {
namespace {

const Eigen::Vector3d kSeenPoint(0.2, 0.35, 0.9);

// A reading near the point's own pixel and depth, off by `off` standard deviations or so.
KeypointTerm SomeTerm(double off) {
  const SeenPoint seen = See(SomeCamera(), kSeenPoint, 0.0);
  KeypointTerm term;
  term.pixel = ProjectCorrected(kLens, SomeCalibration().lens, seen.p).pixel +
               Eigen::Vector2d(0.2 * off, -0.1 * off);
  term.place = DepthPlace(term.pixel, kLens);
  term.depth = {seen.p.z() - 0.003 * off, {0.002, -0.001}};
  term.weight_px = 1.0 / 0.3;
  term.weight_z = 1.0 / 0.005;
  term.depth_after_color_s = 0.006;
  return term;
}

// The cost's own gradient is J'r of the weighted rows, whatever the loss.
TEST(KeypointTerm, RowsGiveTheGradientOfTheCost) {
  for (const double off : {1.0, 20.0}) {  // Within the loss's scale and far outside.
    const KeypointTerm term = SomeTerm(off);
    const auto rows = term.Linearise(kLens, SomeCalibration(), SomeCamera(), kSeenPoint);
    const auto cost = [&](const CalibrationModel& calibration, const CameraState& camera,
                          const Eigen::Vector3d& p_world) {
      return Eigen::Matrix<double, 1, 1>(term.Cost(kLens, calibration, camera, p_world));
    };
    const Eigen::Matrix<double, 1, 3> by_point = rows.r.transpose() * rows.J_point;
    const Eigen::Matrix<double, 1, 6> by_camera = rows.r.transpose() * rows.J_camera;
    const Eigen::Matrix<double, 1, kCalibrationSize> by_calibration =
        rows.CalibrationTimes<1>(rows.r).transpose();
    ASSERT_GT(by_point.norm(), 1.0) << "nothing to compare";
    // Relative: the change of the depth image's offset with the pose is left out on purpose.
    EXPECT_LT((Mismatch<1, 3>(by_point,
                              [&](const Eigen::Vector3d& step) {
                                return cost(SomeCalibration(), SomeCamera(), kSeenPoint + step);
                              })),
              0.01 * by_point.norm());
    EXPECT_LT((Mismatch<1, 6>(by_camera,
                              [&](const Vector6d& step) {
                                return cost(SomeCalibration(), Moved(SomeCamera(), step),
                                            kSeenPoint);
                              })),
              0.01 * by_camera.norm());
    EXPECT_LT((Mismatch<1, kCalibrationSize>(by_calibration,
                                             [&](const CalibrationVector& step) {
                                               return cost(Moved(SomeCalibration(), step),
                                                           SomeCamera(), kSeenPoint);
                                             })),
              0.01 * by_calibration.norm());
  }
}

TEST(KeypointTerm, ResidualsAreWhatTheFormulaSays) {
  // Without motion and errors of the sensor: two pixels, and five millimetres too near.
  CameraState still;
  still.Prepare();
  const Intrinsics lens = {320, 240, 260.0, 260.0, 160.0, 120.0, {}};
  KeypointTerm term;
  term.pixel = {158.0, 120.0};
  term.place = DepthPlace(term.pixel, lens);
  term.depth = {1.005, {0.0, 0.0}};
  term.weight_px = 0.5;
  term.weight_z = 100.0;
  const auto rows = term.Linearise(lens, {}, still, {0.0, 0.0, 1.0});
  const double loss_px = std::log1p(1.0 / 4.0), loss_z = std::log1p(0.25 / 4.0);
  EXPECT_NEAR(rows.r[0], 1.0 / std::sqrt(1.25), 1e-9);
  EXPECT_NEAR(rows.r[1], 0.0, 1e-9);
  EXPECT_NEAR(rows.r[2], -0.5 / std::sqrt(1.0625), 1e-9);
  EXPECT_NEAR(term.Cost(lens, {}, still, {0.0, 0.0, 1.0}), 0.5 * 4.0 * (loss_px + loss_z), 1e-9);
  term.depth.z_m = 0.0;
  EXPECT_NEAR(term.Cost(lens, {}, still, {0.0, 0.0, 1.0}), 0.5 * 4.0 * loss_px, 1e-9);
  EXPECT_EQ(term.Linearise(lens, {}, still, {0.0, 0.0, 1.0}).r[2], 0.0);
  EXPECT_TRUE(std::isinf(term.Cost(lens, {}, still, {0.0, 0.0, -1.0})));
}

}  // namespace
}  // namespace plumb::bundle
