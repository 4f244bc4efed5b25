// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/lens_model.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace plumb {
namespace {

/// A camera whose corner is seen at this angle through an ideal equidistant lens.
Intrinsics SeesTo(double corner_deg) {
  Intrinsics camera{.width = 1280, .height = 960};
  camera.cx = 639.5;
  camera.cy = 479.5;
  camera.fx = camera.fy = std::hypot(camera.cx, camera.cy) / (corner_deg * M_PI / 180.0);
  return camera;
}

TEST(RationalOfEquidistant, AgreesOnTheWholeImage) {
  for (const double corner_deg : {20.0, 45.0, 60.0, 64.0, 68.0, 70.0, 74.0}) {
    for (const std::array<double, 4>& k :
         {std::array<double, 4>{}, {-0.012, 0.031, -0.022, 0.004}, {0.05, -0.02, 0.01, -0.002}}) {
      Intrinsics camera = SeesTo(corner_deg);
      const auto lens = RationalOfEquidistant(k, camera);
      ASSERT_TRUE(lens) << corner_deg << " " << k[0];
      camera.distortion = *lens;
      const double corner_px = std::hypot(camera.cx, camera.cy);
      for (double theta = 0.01; theta < 1.5; theta += 0.01) {
        const double t2 = theta * theta;
        const double radius = theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
        if (camera.fx * radius > corner_px) break;
        const Eigen::Vector2d pixel = Project(camera, {std::tan(theta), 0.0, 1.0});
        ASSERT_NEAR(pixel.x(), camera.cx + camera.fx * radius, 0.05) << corner_deg << " " << theta;
        const Eigen::Vector2d ray = Undistort(camera, pixel);
        ASSERT_NEAR(std::atan(ray.x()), theta, 1e-6) << corner_deg;
      }
    }
  }
}

TEST(RationalOfEquidistant, NothingForWhatSeesToTheSideOrFoldsBack) {
  EXPECT_TRUE(RationalOfEquidistant({}, SeesTo(74.9)));
  EXPECT_FALSE(RationalOfEquidistant({}, SeesTo(75.1)));
  EXPECT_FALSE(RationalOfEquidistant({-0.5, 0, 0, 0}, SeesTo(60)));
  EXPECT_FALSE(RationalOfEquidistant({NAN, 0, 0, 0}, SeesTo(30)));
}

}  // namespace
}  // namespace plumb
