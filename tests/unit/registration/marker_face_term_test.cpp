// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/marker_face_term.hpp"

#include <gtest/gtest.h>

#include "tests/unit/bundle/derivatives.hpp"
#include "tests/unit/registration/depth_term_inputs.hpp"

namespace plumb::dense {
namespace {

// A marker somewhere before the first camera, tilted, so that the middle cell lies on its face.
Pose MarkerAt(const View& view, std::size_t cell) {
  Pose T_depth_marker = PoseFromTwist((Vector6d() << 2.8, 0.2, -0.3, 0, 0, 0).finished());
  T_depth_marker.translation() =
      view.points[cell].cast<double>() + Eigen::Vector3d(0.01, 0.01, 0.005);
  return view.T_world_depth * T_depth_marker;
}

std::size_t MiddleCell(const View& view) {
  return static_cast<std::size_t>((view.height / 2) * view.width + view.width / 2 + 5);
}

TEST(MarkerFaceTerm, DerivativesWithPosesFocalLengthsAndDepth) {
  const auto truth =
      synthetic::MakeTrueMap({.num_keyframes = 2, .num_landmarks = 40, .dense = true});
  const Vector6d none = Vector6d::Zero();
  const MovedViews start(truth, CalibrationVector::Zero(), none, none);
  const std::size_t cell = MiddleCell(start.views[0]);
  ASSERT_GT(start.views[0].points[cell].z(), 0.0F);
  const Pose T_world_marker = MarkerAt(start.views[0], cell);
  const auto row_at = [&](const MovedViews& moved, const Vector6d& of_marker) {
    const Pose T_marker_depth =
        (T_world_marker * PoseFromTwist(of_marker)).inverse() * moved.views[0].T_world_depth;
    return MarkerFaceTerm(moved.sensor, moved.views[0], cell, T_marker_depth).Linearise({});
  };
  const DepthRow row = row_at(start, none);
  const double worst = Mismatch<1, QuadraticTerm::kSize>(
      row.J.transpose(),
      [&](const QuadraticTerm::Vector& step) {
        const MovedViews moved(truth, CalibrationStep(step),
                               step.segment<6>(QuadraticTerm::kTwistA), none);
        return Eigen::Matrix<double, 1, 1>(
            row_at(moved, step.segment<6>(QuadraticTerm::kTwistB)).residual_m);
      },
      kLongStep);
  EXPECT_GT(row.J.cwiseAbs().maxCoeff(), 0.5) << "nothing to compare";
  EXPECT_LT(worst, 0.01);
}

TEST(MarkerFaceTerm, ResidualIsTheHeightAboveTheFaceAsMeasured) {
  const auto truth =
      synthetic::MakeTrueMap({.num_keyframes = 2, .num_landmarks = 40, .dense = true});
  const MovedViews start(truth, CalibrationVector::Zero(), Vector6d::Zero(), Vector6d::Zero());
  const View& view = start.views[0];
  const std::size_t cell = MiddleCell(view);
  const Pose T_marker_depth = MarkerAt(view, cell).inverse() * view.T_world_depth;
  const MarkerFaceTerm term(start.sensor, view, cell, T_marker_depth);
  const double height_m = (T_marker_depth * view.points[cell].cast<double>()).z();
  EXPECT_NEAR(term.Linearise({}).residual_m, height_m / static_cast<double>(view.slopes[cell]),
              1e-9);
  EXPECT_TRUE(term.IsOnFace(0.052, 0.03));
  EXPECT_FALSE(term.IsOnFace(0.052, 0.001)) << "above the face";
  EXPECT_FALSE(term.IsOnFace(0.005, 0.03)) << "beside the face";
}

}  // namespace
}  // namespace plumb::dense
