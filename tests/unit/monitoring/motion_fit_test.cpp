// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/motion_fit.hpp"

#include <gtest/gtest.h>

#include "algo/base/units.hpp"
#include "tests/unit/monitoring/small_view.hpp"

namespace plumb {
namespace {

using test::BumpyMesh;

class MotionFitTest : public testing::Test {
 protected:
  [[nodiscard]] FitView ViewOf(const BlockImage& image) const {
    return {.grid = grid_,
            .model = model_,
            .image = image,
            .T_scene_camera = test::CameraOfScene().inverse()};
  }
  [[nodiscard]] MotionFit Fit(const BlockImage& image) const {
    const FitView view = ViewOf(image);
    return FitMotion({&view, 1}, Eigen::Vector3d::Zero(), {});
  }

  BlockGrid grid_{test::SmallCamera()};
  ViewModel model_ = test::ModelOf(test::Seen(BumpyMesh(), grid_), grid_);
};

TEST_F(MotionFitTest, FindsAMotionWithoutNoiseToATenthOfAMillimetre) {
  Vector6d twist;
  twist << 0.01, -0.015, 0.02, 0.006, -0.004, 0.005;
  const Pose T = PoseFromTwist(twist);
  const MotionFit fit = Fit(test::Seen(BumpyMesh(T), grid_));
  EXPECT_TRUE(fit.converged);
  const Pose error = fit.T * T.inverse();
  EXPECT_LT(error.translation().norm(), 0.15 * kMillimetre);
  EXPECT_LT(RotationAngle(error), 0.05 * kDegree);
  EXPECT_GT(fit.visible(), 0.85);
}

TEST_F(MotionFitTest, WhatLiesBeforeTheSurfaceIsNotSeenAsItsMotion) {
  BlockImage image = test::Seen(BumpyMesh(), grid_);
  const std::size_t half = grid_.size() / 2;
  for (std::size_t b = half; b < grid_.size(); ++b) image.inverse_depth[b] = 1.0F / 0.6F;
  const MotionFit fit = Fit(image);
  EXPECT_LT(fit.visible(), 0.6);
  EXPECT_LT(fit.T.translation().norm(), 0.05 * kMillimetre);
}

TEST_F(MotionFitTest, ALearnedRiseIsBreathingAndNotMotion) {
  const auto bulge = [](double x, double y) { return std::exp(-(x * x + y * y) / 0.01); };
  const auto raised = [&](double x, double y) { return 0.008 * bulge(x, y); };
  const BlockImage image = test::Seen(BumpyMesh(Pose::Identity(), raised), grid_);
  std::vector<float> rise(grid_.size(), 0.0F);
  for (std::size_t b = 0; b < rise.size(); ++b)
    rise[b] =
        static_cast<float>(bulge(model_.point[b].x(), model_.point[b].y())) * model_.normal[b].z();
  FitView view = ViewOf(image);
  const MotionFit rigid = FitMotion({&view, 1}, Eigen::Vector3d::Zero(), {});
  view.modes[0] = &rise;
  const MotionFit breathing = FitMotion({&view, 1}, Eigen::Vector3d::Zero(), {});
  EXPECT_GT(rigid.T.translation().norm(), 1.0 * kMillimetre);
  EXPECT_LT(breathing.T.translation().norm(), 0.3 * kMillimetre);
  EXPECT_NEAR(breathing.views[0].modes_m[0], 0.008, 0.3 * kMillimetre);
}

TEST_F(MotionFitTest, TwoSensorsKnowMoreThanOneAndEachItsOwnBreathing) {
  const auto bulge = [](double x, double y) { return std::exp(-(x * x + y * y) / 0.01); };
  Vector6d twist;
  twist << 0.01, 0.0, 0.015, 0.004, -0.003, 0.002;
  const Pose T = PoseFromTwist(twist);
  const BlockImage breathed =
      test::Seen(BumpyMesh(T, [&](double x, double y) { return 0.006 * bulge(x, y); }), grid_);
  const BlockImage exhaled = test::Seen(BumpyMesh(T), grid_);
  std::vector<float> rise(grid_.size(), 0.0F);
  for (std::size_t b = 0; b < rise.size(); ++b)
    rise[b] =
        static_cast<float>(bulge(model_.point[b].x(), model_.point[b].y())) * model_.normal[b].z();
  std::vector<FitView> views = {ViewOf(breathed), ViewOf(exhaled)};
  for (FitView& view : views) view.modes[0] = &rise;
  const MotionFit both = FitMotion(views, Eigen::Vector3d::Zero(), {});
  const MotionFit one = FitMotion({&views[1], 1}, Eigen::Vector3d::Zero(), {});
  ASSERT_TRUE(both.converged && one.converged);
  EXPECT_LT((both.T * T.inverse()).translation().norm(), 0.3 * kMillimetre);
  EXPECT_NEAR(both.views[0].modes_m[0], 0.006, 0.3 * kMillimetre);
  EXPECT_NEAR(both.views[1].modes_m[0], 0.0, 0.3 * kMillimetre);
  EXPECT_GT(both.information.diagonal().minCoeff(), 1.8 * one.information.diagonal().minCoeff());
}

TEST_F(MotionFitTest, NothingSeenIsNoFit) {
  const BlockImage image{.inverse_depth = std::vector<float>(grid_.size(), 0.0F),
                         .ray = grid_.centre_ray};
  const MotionFit fit = Fit(image);
  EXPECT_FALSE(fit.converged);
  EXPECT_EQ(fit.views.at(0).num_used, 0);
}

}  // namespace
}  // namespace plumb
