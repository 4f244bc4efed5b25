// SPDX-License-Identifier: Apache-2.0
#include "algo/bundle/corner_term.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/unit/bundle/derivatives.hpp"
#include "tests/unit/bundle/term_inputs.hpp"

namespace plumb::bundle {
namespace {

const Pose kMarker = PoseFromTwist((Vector6d() << 0.2, 0.1, -0.3, 0.2, 0.35, 0.9).finished());
const Vector6d kTwist = (Vector6d() << 0.01, -0.02, 0.015, 0.002, 0.001, -0.003).finished();

CornerTerm SomeCorner(double off_px) {
  CornerTerm term;
  term.in_marker = {0.05, -0.05, 0.0};
  const Eigen::Vector3d p = See(SomeCamera(), term.InWorld({kMarker, kTwist}), 0.0).p;
  term.pixel = ProjectCorrected(kLens, SomeCalibration().lens, p).pixel +
               Eigen::Vector2d(off_px, -0.5 * off_px);
  term.inward = {0.7, -0.4};
  term.weight = 1.0 / 0.2;
  return term;
}

TEST(CornerTerm, RowsGiveTheGradientOfTheCost) {
  for (const double off_px : {0.2, 4.0}) {  // Within the loss's scale and far outside.
    const CornerTerm term = SomeCorner(off_px);
    const auto rows = term.Linearise(kLens, SomeCalibration(), SomeCamera(), {kMarker, kTwist});
    const auto cost = [&](const CalibrationModel& calibration, const CameraState& camera,
                          const Vector6d& twist) {
      return Eigen::Matrix<double, 1, 1>(term.Cost(kLens, calibration, camera, {kMarker, twist}));
    };
    const Vector6d by_marker = rows.J_marker.transpose() * rows.r;
    const Vector6d by_camera = rows.J_camera.transpose() * rows.r;
    CalibrationVector by_calibration = CalibrationVector::Zero();
    by_calibration.head<kSeenByCorners>() = rows.J_calibration.transpose() * rows.r;
    ASSERT_GT(by_marker.norm(), 1.0) << "nothing to compare";
    EXPECT_LT((Mismatch<1, 6>(by_marker.transpose(),
                              [&](const Vector6d& step) {
                                return cost(SomeCalibration(), SomeCamera(), kTwist + step);
                              })),
              1e-3 * by_marker.norm());
    EXPECT_LT((Mismatch<1, 6>(by_camera.transpose(),
                              [&](const Vector6d& step) {
                                return cost(SomeCalibration(), Moved(SomeCamera(), step), kTwist);
                              })),
              1e-3 * by_camera.norm());
    EXPECT_LT((Mismatch<1, kCalibrationSize>(by_calibration.transpose(),
                                             [&](const CalibrationVector& step) {
                                               return cost(Moved(SomeCalibration(), step),
                                                           SomeCamera(), kTwist);
                                             })),
              1e-3 * by_calibration.norm());
  }
}

TEST(CornerTerm, ResidualIsWhatTheFormulaSays) {
  CameraState still;
  still.Prepare();
  const Intrinsics lens = {320, 240, 260.0, 260.0, 160.0, 120.0, {}};
  const Pose marker(Eigen::Translation3d(0.0, 0.0, 1.0));
  const Vector6d none = Vector6d::Zero();
  CalibrationModel calibration;
  calibration.edge_bias_px = {0.1};
  CornerTerm term;
  term.in_marker = {0.1, 0.0, 0.0};
  term.pixel = {186.0, 121.0};  // The corner's projection is (186, 120).
  term.inward = {-1.0, 1.0};
  term.weight = 2.0;
  const auto rows = term.Linearise(lens, calibration, still, {marker, none});
  const Eigen::Vector2d r(-0.2, -1.8);
  EXPECT_LT((rows.r - r / std::sqrt(1.0 + r.squaredNorm() / 9.0)).norm(), 1e-9);
  EXPECT_NEAR(term.Cost(lens, calibration, still, {marker, none}),
              0.5 * 9.0 * std::log1p(r.squaredNorm() / 9.0), 1e-9);
  EXPECT_TRUE(std::isinf(
      term.Cost(lens, calibration, still, {Pose(Eigen::Translation3d(0, 0, -1)), none})));
}

}  // namespace
}  // namespace plumb::bundle
