// SPDX-License-Identifier: Apache-2.0
#include "algo/geometry/back_projection.hpp"

#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

namespace plumb {
namespace {

Intrinsics WithLens() {
  Intrinsics intrinsics{
      .width = 320, .height = 240, .fx = 262.0, .fy = 263.0, .cx = 158.3, .cy = 121.9};
  intrinsics.distortion = {0.0633, -0.2018, 4.8e-4, 2.1e-4, 0.0573};
  return intrinsics;
}

// Truth: the forward model. Whatever pixel the ray is drawn in must be the pixel it belongs to.
TEST(RayTableTest, RaysProjectBackOntoTheirPixels) {
  for (const Intrinsics& intrinsics :
       {WithLens(),
        Intrinsics{.width = 64, .height = 48, .fx = 60, .fy = 61, .cx = 30, .cy = 25}}) {
    const RayTable rays(intrinsics);
    double worst_px = 0.0;
    for (int row = 0; row < rays.height(); ++row) {
      for (int column = 0; column < rays.width(); ++column) {
        const Eigen::Vector2d pixel =
            Project(intrinsics, rays.ideal(row, column).cast<double>().homogeneous());
        worst_px = std::max(worst_px, (pixel - Eigen::Vector2d(column, row)).norm());
      }
    }
    // Single precision of a ray of length 0.7 is 6e-8, times 263 px: 1.6e-5. Measured 2e-5.
    EXPECT_LT(worst_px, 1e-4);
  }
}

TEST(RayTablesTest, OneTablePerCamera) {
  RayTables tables;
  const auto first = tables.For(WithLens());
  Intrinsics other = WithLens();
  other.cx += 1.0;
  EXPECT_EQ(tables.For(WithLens()), first);
  EXPECT_NE(tables.For(other), first);
}

TEST(BackProjectTest, ValidPixelsBecomePointsWithTheirColours) {
  const RayTable rays(WithLens());
  DepthView view;
  view.intrinsics = WithLens();
  view.depth_m = cv::Mat::zeros(240, 320, CV_32FC1);
  view.color_rgb = cv::Mat::zeros(240, 320, CV_8UC3);
  view.depth_m.at<float>(10, 300) = 1.5F;
  view.depth_m.at<float>(200, 7) = 0.8F;
  view.depth_m.at<float>(3, 3) = std::numeric_limits<float>::quiet_NaN();
  view.color_rgb.at<cv::Vec3b>(200, 7) = {1, 2, 3};
  const PointCloud cloud = BackProject(view, rays);
  ASSERT_EQ(cloud.size(), 2U);
  ASSERT_EQ(cloud.colors.size(), 2U);
  EXPECT_EQ(cloud.colors[1], (Color{1, 2, 3}));
  EXPECT_FLOAT_EQ(cloud.points[0].z(), 1.5F);
  const Eigen::Vector2d pixel = Project(WithLens(), cloud.points[0].cast<double>());
  EXPECT_NEAR(pixel.x(), 300.0, 1e-4);
  EXPECT_NEAR(pixel.y(), 10.0, 1e-4);
}

TEST(BackProjectTest, NamesACallersMistake) {
  Intrinsics bad = WithLens();
  bad.fx = 0.0;
  EXPECT_THROW(RayTable{bad}, std::invalid_argument);
  bad = WithLens();
  bad.width = 1 << 20;
  EXPECT_THROW(RayTable{bad}, std::invalid_argument);
  const RayTable rays(WithLens());
  DepthView view;
  view.intrinsics = WithLens();
  view.depth_m = cv::Mat::zeros(240, 321, CV_32FC1);
  EXPECT_THROW((void)BackProject(view, rays), std::invalid_argument);
  view.depth_m = cv::Mat::zeros(240, 320, CV_16UC1);
  EXPECT_THROW((void)BackProject(view, rays), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
