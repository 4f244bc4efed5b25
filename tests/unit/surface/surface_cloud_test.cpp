// SPDX-License-Identifier: Apache-2.0
#include "algo/surface/surface_cloud.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "algo/base/units.hpp"
#include "tests/support/analytic_scene.hpp"

namespace plumb {
namespace {

using testing::DomeScene;
using testing::ShiftDepth;
using testing::SweepOverDome;

/// Distance from the dome's surface along its normal (first order), where the surface is not steep;
/// NaN elsewhere.
double Distance(const DomeScene& scene, const Eigen::Vector3f& p) {
  const Eigen::Vector3d n = scene.Normal(p.x(), p.y());
  return n.z() < 0.5 ? std::nan("") : (p.z() - scene.Height(p.x(), p.y())) * n.z();
}

TEST(MergeSurfaceTest, IsThinnerThanTheNoiseOfAnyView) {
  const DomeScene scene;
  for (const int width : {640, 320}) {
    const PointCloud cloud = MergeSurface(PrepareViews(SweepOverDome(scene, 8, width, 0.003)));
    ASSERT_GT(cloud.size(), 30000U);
    ASSERT_EQ(cloud.normals.size(), cloud.size());
    double sum_squared = 0.0;
    double worst_tilt = 0.0;
    double sum_tilt = 0.0;
    int count = 0;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const Eigen::Vector3f& p = cloud.points[i];
      const double distance = Distance(scene, p);
      if (!std::isfinite(distance) || scene.Height(p.x(), p.y()) < 0.02) continue;
      sum_squared += distance * distance;
      const double tilt =
          std::acos(std::min(1.0, cloud.normals[i].cast<double>().dot(scene.Normal(p.x(), p.y()))));
      sum_tilt += tilt;
      worst_tilt = std::max(worst_tilt, tilt);
      ++count;
    }
    ASSERT_GT(count, 8000);
    // Noise 3 mm a pixel, 1.5 mm a working pixel at 640 columns; merged measured 0.75 mm (640)
    // and 1.4 mm (320).
    EXPECT_LT(std::sqrt(sum_squared / count), width == 640 ? 1.1e-3 : 2.0e-3);
    EXPECT_LT(sum_tilt / count, 6 * kDegree);
  }
}

TEST(MergeSurfaceTest, OnePointAVoxelAndColoursOfTheirPlace) {
  const DomeScene scene;
  const SurfaceCloudOptions options{.voxel_size_m = 0.005F};
  const PointCloud cloud = MergeSurface(PrepareViews(SweepOverDome(scene, 5, 320, 0.001)), options);
  ASSERT_EQ(cloud.colors.size(), cloud.size());
  std::set<std::array<int, 3>> voxels;
  int num_wrong = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Eigen::Vector3f& p = cloud.points[i];
    voxels.insert({static_cast<int>(std::floor(p.x() / 0.005F)),
                   static_cast<int>(std::floor(p.y() / 0.005F)),
                   static_cast<int>(std::floor(p.z() / 0.005F))});
    const double height = scene.Height(p.x(), p.y());
    if (height > 0.03) num_wrong += cloud.colors[i][0] == 200 ? 0 : 1;
    EXPECT_NEAR(cloud.normals[i].norm(), 1.0F, 1e-5F);
  }
  // A mean of points in a voxel can round over its border: a handful at most.
  EXPECT_GE(voxels.size() + 5, cloud.size());
  EXPECT_LT(num_wrong, static_cast<int>(cloud.size() / 200));
}

TEST(MergeSurfaceTest, WhatOneViewAloneSawIsLeftOut) {
  const DomeScene scene;
  auto views = SweepOverDome(scene, 6, 320, 0.0);
  testing::ShiftDepth(views[2], cv::Rect(100, 80, 60, 60),
                      -0.2F);  // a hand, 20 cm above everything
  for (const Eigen::Vector3f& p : MergeSurface(PrepareViews(views)).points)
    EXPECT_LT(p.z(), scene.c + 0.02);
}

TEST(MergeSurfaceTest, DepthEdgesLeaveNoPointsBetweenSurfaces) {
  // A plate of 20 cm at 30 cm over the floor, with edge pixels that hold the mean of both depths.
  Intrinsics intrinsics;
  std::vector<DepthView> views;
  for (int i = 0; i < 4; ++i) {
    DepthView view;
    view.intrinsics = intrinsics;
    view.T_world_camera = testing::LookAt({0.05 * i, 0, 1.0}, {0.05 * i, 0, 0});
    view.depth_m = cv::Mat(480, 640, CV_32FC1, cv::Scalar(1.0));
    const int shift = static_cast<int>(std::lround(0.05 * i * 525 / 0.7));
    const cv::Rect plate(245 - shift, 165, 150, 150);
    view.depth_m(cv::Rect(plate.x - 1, plate.y - 1, plate.width + 2, plate.height + 2)) = 0.85F;
    view.depth_m(plate) = 0.7F;
    views.push_back(view);
  }
  int num_on_plate = 0;
  for (const Eigen::Vector3f& p : MergeSurface(PrepareViews(views)).points) {
    EXPECT_TRUE(std::abs(p.z()) < 0.005F || std::abs(p.z() - 0.3F) < 0.005F) << p.transpose();
    num_on_plate += p.z() > 0.2F ? 1 : 0;
  }
  EXPECT_GT(num_on_plate, 2500);  // 20 x 20 cm at 3 mm are 4400 voxels, less the rims
}

TEST(MergeSurfaceTest, SameBitsWhateverTheNumberOfThreads) {
  const auto views = SweepOverDome(DomeScene{}, 5, 320, 0.002);
  const PointCloud first = MergeSurface(PrepareViews(views));
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  const PointCloud second = MergeSurface(PrepareViews(views));
  EXPECT_EQ(first.points, second.points);
  EXPECT_EQ(first.normals, second.normals);
  EXPECT_EQ(first.colors, second.colors);
}

TEST(MergeSurfaceTest, EmptyInputsAndCallersMistakes) {
  EXPECT_TRUE(MergeSurface({}).empty());
  DepthView blind;
  blind.depth_m = cv::Mat::zeros(480, 640, CV_32FC1);
  EXPECT_TRUE(MergeSurface(PrepareViews(std::vector{blind})).empty());
  EXPECT_THROW((void)MergeSurface(PrepareViews(std::vector{blind}), {.voxel_size_m = 0.0F}),
               std::invalid_argument);
  blind.T_world_camera.translation().x() = std::nan("");
  EXPECT_THROW((void)MergeSurface(PrepareViews(std::vector{blind})), std::invalid_argument);
}

TEST(PrepareViewsTest, WeightsAndEdgesFollowTheNoiseThatIsStatedForTheSensor) {
  const DomeScene scene;
  const std::vector<DepthView> views = SweepOverDome(scene, 2, 320, 0.0);
  const auto prepared = [&](const DepthNoise& noise) {
    return PrepareViews(views, {.depth_noise = noise}).front();
  };
  const ViewSurface usual = prepared({});
  const DepthNoise twice = {
      .constant_m = 2 * 0.0012, .quadratic_m_per_m2 = 2 * 0.0019, .grazing_m = 2 * 0.0001};
  const ViewSurface noisy = prepared(twice);
  EXPECT_EQ(noisy.depth_noise, twice);
  int num_compared = 0, num_usual = 0, num_blurred = 0;
  for (std::size_t i = 0; i < usual.size(); ++i) {
    num_usual += usual.pixels[i].inverse_depth > 0 ? 1 : 0;
    if (!(usual.pixels[i].weight > 0) || usual.normals[i] != noisy.normals[i]) continue;
    ++num_compared;
    ASSERT_NEAR(usual.pixels[i].weight / noisy.pixels[i].weight, 4.0F, 1e-4F);
  }
  EXPECT_GT(num_compared, 10000);
  // Where depth scatters by 5 cm, a step of a few centimetres is no edge.
  const ViewSurface blurred = prepared({.constant_m = 0.05});
  for (const ViewSurface::Pixel& pixel : blurred.pixels) num_blurred += pixel.weight > 0 ? 1 : 0;
  EXPECT_GT(num_blurred, num_compared);
  EXPECT_GE(num_usual, num_compared);
}

TEST(MergeSurfaceTest, ViewsAgreeWithinFourSigmasOfTheirSensor) {
  const DomeScene scene;
  std::vector<DepthView> views = SweepOverDome(scene, 6, 320, 0.0);
  for (std::size_t i = 0; i < views.size(); i += 2)
    ShiftDepth(views[i], cv::Rect(0, 0, 320, 240), 0.02F);
  // Standard deviation of the floor's height.
  const auto thickness_m = [&](double constant_m) {
    const DepthNoise noise = {.constant_m = constant_m, .quadratic_m_per_m2 = 0.0};
    double sum = 0.0, sum_squared = 0.0;
    int count = 0;
    for (const Eigen::Vector3f& p :
         MergeSurface(PrepareViews(views, {.depth_noise = noise})).points) {
      if (std::hypot(p.x() - scene.x, p.y() - scene.y) < 1.5 * scene.a) continue;
      sum += p.z();
      sum_squared += p.z() * p.z();
      ++count;
    }
    EXPECT_GT(count, 1000);
    return std::sqrt(sum_squared / count - (sum / count) * (sum / count));
  };
  // Two layers that are 2 cm apart; the same surface where 4 sigma are 8 cm.
  const double apart_m = thickness_m(0.001), merged_m = thickness_m(0.02);
  EXPECT_GT(apart_m, 0.007);
  EXPECT_LT(merged_m, 0.7 * apart_m);
}

}  // namespace
}  // namespace plumb
