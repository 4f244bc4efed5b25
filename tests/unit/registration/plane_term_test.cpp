// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/plane_term.hpp"

#include <cmath>
#include <optional>

#include <gtest/gtest.h>

#include "tests/unit/bundle/derivatives.hpp"
#include "tests/unit/registration/depth_term_inputs.hpp"

namespace plumb::dense {
namespace {

using Step = QuadraticTerm::Vector;

// The term between a cell of the first view and one of the second, unless they do not match.
std::optional<PlaneTerm> TermAt(const ViewPair& pair, std::size_t cell_a, std::size_t cell_b) {
  const Eigen::Vector3f in_b = pair.T_b_a.linear().cast<float>() * pair.a.points[cell_a] +
                               pair.T_b_a.translation().cast<float>();
  return PlaneTerm::Between(pair, cell_a, cell_b, in_b, pair.T_b_a.linear().cast<float>(), 0.1);
}

struct CellPair {
  std::size_t a = 0;
  std::size_t b = 0;
};
CellPair SomeCells(const ViewPair& pair) {
  for (std::size_t a = 0; a < pair.a.points.size(); ++a) {
    if (pair.a.keyframe->dense.normals[a].isZero()) continue;
    const Eigen::Vector2d pixel =
        Project(pair.sensor.depth, pair.T_b_a * pair.a.points[a].cast<double>());
    const int window = pair.a.keyframe->dense.window_px;
    const int c = static_cast<int>(pixel.x()) / window, r = static_cast<int>(pixel.y()) / window;
    if (c < 2 || r < 2 || c + 2 >= pair.b.width || r + 2 >= pair.b.height) continue;
    const auto b = static_cast<std::size_t>(r * pair.b.width + c);
    if (a % 7 == 3 && TermAt(pair, a, b)) return {a, b};
  }
  ADD_FAILURE() << "no cells match";
  return {};
}

// Two views of the true map, and a term between two of their cells.
class PlaneTermTest : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(term); }

  const decltype(synthetic::MakeTrueMap({})) truth = synthetic::MakeTrueMap(
      {.num_keyframes = 2, .num_landmarks = 40, .markers = false, .dense = true});
  const MovedViews start{truth, CalibrationVector::Zero(), Vector6d::Zero(), Vector6d::Zero()};
  const ViewPair pair{start.sensor, start.views[0], start.views[1]};
  const CellPair cells = SomeCells(pair);
  const decltype(TermAt(pair, cells.a, cells.b)) term = TermAt(pair, cells.a, cells.b);
};

TEST_F(PlaneTermTest, DerivativesWithPosesFocalLengthsAndDepth) {
  const DepthRow row = term->Linearise(pair, {});
  const double worst = Mismatch<1, QuadraticTerm::kSize>(
      row.J.transpose(),
      [&](const Step& step) {
        const MovedViews moved(truth, CalibrationStep(step),
                               step.segment<6>(QuadraticTerm::kTwistA),
                               step.segment<6>(QuadraticTerm::kTwistB));
        const ViewPair moved_pair(moved.sensor, moved.views[0], moved.views[1]);
        return Eigen::Matrix<double, 1, 1>(
            TermAt(moved_pair, cells.a, cells.b)->Linearise(moved_pair, {}).residual_m);
      },
      kLongStep);
  EXPECT_GT(row.J.cwiseAbs().maxCoeff(), 0.5) << "nothing to compare";
  EXPECT_LT(worst, 0.01);
}

TEST_F(PlaneTermTest, ResidualIsWhatTheFormulaSays) {
  const Eigen::Vector3d x_a = start.views[0].points[cells.a].cast<double>();
  const Eigen::Vector3d x_b = start.views[1].points[cells.b].cast<double>();
  const Eigen::Vector3d n = start.map.keyframes[1].dense.normals[cells.b].cast<double>();
  const double sigma_a = DepthSigma({}, x_a.z(), term->cos_a) * term->cos_a;
  const double sigma_b = DepthSigma({}, x_b.z(), term->cos_b) * term->cos_b;
  const double slope = std::hypot(sigma_a * start.views[0].slopes[cells.a],
                                  sigma_b * start.views[1].slopes[cells.b]) /
                       std::hypot(sigma_a, sigma_b);
  const DepthRow row = term->Linearise(pair, {});
  EXPECT_NEAR(row.residual_m, n.dot(pair.T_b_a * x_a - x_b) / slope, 1e-6);
  EXPECT_GT(std::abs(slope - 1.0), 1e-3) << "nothing to convert";
  EXPECT_GT(row.sigma_m, kUnmodelled_m);
  EXPECT_LT(row.sigma_m, 0.01);
  EXPECT_FALSE(PlaneTerm::Between(pair, cells.a, cells.b, term->in_b + 0.2F * term->normal,
                                  pair.T_b_a.linear().cast<float>(), 0.1))
      << "beyond the gate";
}

}  // namespace
}  // namespace plumb::dense
