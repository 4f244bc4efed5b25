// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/row_motion_term.hpp"

#include <gtest/gtest.h>

#include "tests/unit/bundle/derivatives.hpp"
#include "tests/unit/bundle/term_inputs.hpp"

namespace plumb {
namespace {

using bundle::kLens;
using bundle::SomeCalibration;
using bundle::SomeCamera;
using Vector12d = Eigen::Matrix<double, 12, 1>;

const Eigen::Vector3d kPoint(0.2, 0.35, 0.9);

RowMotionTerm SomeRow(double loss_scale) {
  return {kPoint, {280.0, 30.0}, {0.3, -0.2}, 2.0, loss_scale};
}

TEST(RowMotionTerm, DerivativesWithPoseAndVelocity) {
  const RowMotionTerm term = SomeRow(1e9);  // Without the loss, of which the weight is constant.
  const auto rows = term.Linearise(kLens, SomeCalibration(), SomeCamera());
  ASSERT_TRUE(rows);
  ASSERT_GT(rows->J.rightCols<6>().norm(), 0.1) << "nothing to compare";
  const double worst = Mismatch<2, 12>(rows->J, [&](const Vector12d& step) {
    bundle::CameraState camera = Moved(SomeCamera(), Vector6d(step.head<6>()));
    camera.velocity_per_s += step.tail<6>();
    return term.Linearise(kLens, SomeCalibration(), camera)->r;
  });
  EXPECT_LT(worst, 1e-4 * rows->J.norm());
}

TEST(RowMotionTerm, ResidualIsWhatTheFormulaSays) {
  bundle::CameraState camera;
  camera.velocity_per_s << 0, 0, 0, 1.0, 0, 0;
  camera.Prepare();
  const Intrinsics lens = {320, 240, 260.0, 260.0, 160.0, 120.0, {}};
  CalibrationModel calibration;
  calibration.readout_s = {0.02};
  // The last row, read 10 ms after the stamp: the camera is 1 cm further to the right by then.
  const double dt_s = 0.02 * ((239.0 + 0.5) / 240.0 - 0.5);
  const RowMotionTerm term{{0.0, 0.0, 1.0}, {150.0, 239.0}, {1.0, 0.0}, 2.0, 1e9};
  const auto rows = term.Linearise(lens, calibration, camera);
  ASSERT_TRUE(rows);
  EXPECT_NEAR(rows->r.x(), 2.0 * (160.0 - 260.0 * dt_s + 1.0 - 150.0), 1e-9);
  EXPECT_NEAR(rows->r.y(), 2.0 * (120.0 - 239.0), 1e-9);
  EXPECT_FALSE((RowMotionTerm{{0, 0, -1}, {150, 239}, {0, 0}, 2.0, 1.0})
                   .Linearise(lens, calibration, camera));
}

}  // namespace
}  // namespace plumb
