// SPDX-License-Identifier: Apache-2.0
#include "algo/reconstruction/breathing.hpp"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "algo/base/units.hpp"
#include "algo/surface/surface_cloud.hpp"
#include "tests/support/analytic_scene.hpp"

namespace plumb {
namespace {

using testing::DomeScene;

constexpr double kPeriod_s = 4.0;
constexpr int kNumViews = 30;

/// What a sweep of 8 s found over a dome that rises and falls by `rise_m`, with noise and errors of
/// the poses.
std::optional<Breathing> BreathingOf(double rise_m, double duration_s = 8.0) {
  const RayTable rays(Resized({}, 320, 240));
  std::vector<DepthView> views;
  std::vector<double> times_s;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const auto vector = [&] {
    return Eigen::Vector3d(normal(random), normal(random), normal(random));
  };
  for (int i = 0; i < kNumViews; ++i) {
    times_s.push_back(1e9 + duration_s * i / (kNumViews - 1));
    DomeScene scene;
    scene.c += 0.5 * rise_m * std::sin(2.0 * std::numbers::pi * times_s.back() / kPeriod_s + 0.7);
    const double along = static_cast<double>(i) / kNumViews;
    const Eigen::Vector3d target(scene.x - 0.3 + 0.6 * along, scene.y, 0.05);
    const Eigen::Vector3d position(target.x(), scene.y + 0.35 * std::sin(11.0 * along), 0.95);
    views.push_back(testing::RenderDome(scene, rays, testing::LookAt(position, target), 0.001,
                                        static_cast<unsigned>(i)));
    Vector6d error;
    error << 5e-4 * vector(), 5e-4 * vector();
    views.back().T_world_camera = PoseFromTwist(error) * views.back().T_world_camera;
  }
  const std::vector<ViewSurface> surfaces = PrepareViews(views);
  return FindBreathing(MeasurePatches(surfaces, MergeSurface(surfaces)), times_s);
}

TEST(BreathingTest, TheRiseAndItsPeriodAreFound) {
  for (const double rise_m : {0.004, 0.010}) {
    const std::optional<Breathing> found = BreathingOf(rise_m);
    ASSERT_TRUE(found) << rise_m;
    EXPECT_GT(found->amplitude_m, 0.7 * rise_m);
    EXPECT_LT(found->amplitude_m, 1.1 * rise_m);
    EXPECT_NEAR(found->period_s, kPeriod_s, 0.4) << rise_m;
    EXPECT_GT(found->sigma_m, 0.0);
    EXPECT_LT(found->sigma_m, 0.3 * rise_m);
  }
}

TEST(BreathingTest, NoneIsFoundOverABodyAtRest) {
  const std::optional<Breathing> none = BreathingOf(0.0);
  ASSERT_TRUE(none);
  EXPECT_EQ(none->amplitude_m, 0.0);
  EXPECT_EQ(none->period_s, 0.0);
  EXPECT_GT(none->limit_m, 0.0);
  EXPECT_LT(none->limit_m, 0.003);
}

TEST(BreathingTest, AShortSweepOrFewViewsCannotTell) {
  EXPECT_FALSE(BreathingOf(0.010, 2.9));
  EXPECT_FALSE(FindBreathing({}, std::vector<double>(30, 0.0)));
  const SurfacePatch patch{.samples = {{0, 0.0F, 1.0F}}};
  EXPECT_FALSE(FindBreathing({&patch, 1}, std::vector<double>{0, 1, 2, 3, 4, 5, 6}));
}

TEST(BreathingTest, OneThreadFindsTheSameBits) {
  const std::optional<Breathing> several = BreathingOf(0.006);
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  const std::optional<Breathing> one = BreathingOf(0.006);
  ASSERT_TRUE(several && one);
  EXPECT_EQ(one->amplitude_m, several->amplitude_m);
  EXPECT_EQ(one->sigma_m, several->sigma_m);
  EXPECT_EQ(one->period_s, several->period_s);
}

}  // namespace
}  // namespace plumb
