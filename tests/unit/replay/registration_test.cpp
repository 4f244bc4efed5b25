// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/registration.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

Intrinsics DepthCamera() {
  return {.width = 320,
          .height = 240,
          .fx = 290,
          .fy = 289,
          .cx = 158,
          .cy = 121,
          .distortion = {0.02, -0.05, 0, 0.001, 0}};
}
Intrinsics ColorCamera() {
  return {.width = 320,
          .height = 240,
          .fx = 262,
          .fy = 263,
          .cx = 161,
          .cy = 118,
          .distortion = {0.06, -0.2, 0, 0, 0.05}};
}
Pose BesideEachOther() {
  Pose T_color_depth = Pose::Identity();
  T_color_depth.linear() = RotationFromVector(Eigen::Vector3d(0.2, -0.3, 0.5) * kDegree);
  T_color_depth.translation() = Eigen::Vector3d(0.025, 0.001, -0.002);
  return T_color_depth;
}

/// A plane n.p = d in the colour camera's frame.
struct Plane {
  Eigen::Vector3d normal;
  double distance_m;
  /// z where the ray of a pixel of a camera meets it; T_color_camera places that camera.
  [[nodiscard]] double ZAlong(const Intrinsics& camera, const Pose& T_color_camera, int x,
                              int y) const {
    const Eigen::Vector3d ray =
        T_color_camera.linear() * Undistort(camera, Eigen::Vector2d(x, y)).homogeneous();
    return (distance_m - normal.dot(T_color_camera.translation())) / normal.dot(ray);
  }
};

cv::Mat Render(const Plane& plane, const Intrinsics& camera, const Pose& T_color_camera) {
  cv::Mat depth_m(camera.height, camera.width, CV_32FC1);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x)
      depth_m.at<float>(y, x) = static_cast<float>(plane.ZAlong(camera, T_color_camera, x, y));
  }
  return depth_m;
}

TEST(DepthRegistrationTest, TiltedPlaneLandsOnItselfWithoutHoles) {
  const Plane plane{Eigen::Vector3d(0.3, -0.2, 1.0), 0.9};
  const DepthRegistration registration(DepthCamera(), ColorCamera(), BesideEachOther());
  const cv::Mat registered = registration.Register(Render(plane, DepthCamera(), BesideEachOther()));
  ASSERT_EQ(registered.size(), cv::Size(320, 240));

  double worst_m = 0;
  int holes = 0;
  for (int y = 30; y < 210; ++y) {
    for (int x = 40; x < 280; ++x) {
      const double z = registered.at<float>(y, x);
      if (z == 0) {
        ++holes;
        continue;
      }
      worst_m =
          std::max(worst_m, std::abs(z - plane.ZAlong(ColorCamera(), Pose::Identity(), x, y)));
    }
  }
  EXPECT_EQ(holes, 0);
  // A sample's centre lies up to one pixel from the pixel that takes it, and the plane falls by 1.3
  // mm a pixel. Measured 1.20 mm.
  EXPECT_LT(worst_m, 2.0 * kMillimetre);
}

TEST(DepthRegistrationTest, FinerColourImageHasNoSeams) {
  Intrinsics color = Resized(ColorCamera(), 640, 480);
  const Plane plane{Eigen::Vector3d(-0.4, 0.1, 1.0), 0.8};
  const DepthRegistration registration(DepthCamera(), color, BesideEachOther());
  const cv::Mat registered = registration.Register(Render(plane, DepthCamera(), BesideEachOther()));
  int holes = 0;
  for (int y = 60; y < 420; ++y) {
    for (int x = 80; x < 560; ++x) holes += registered.at<float>(y, x) == 0 ? 1 : 0;
  }
  EXPECT_EQ(holes, 0);
}

TEST(DepthRegistrationTest, SameCameraGivesTheSameImage) {
  const Plane plane{Eigen::Vector3d(0.1, 0.1, 1.0), 1.1};
  const cv::Mat depth_m = Render(plane, DepthCamera(), Pose::Identity());
  const cv::Mat registered =
      DepthRegistration(DepthCamera(), DepthCamera(), Pose::Identity()).Register(depth_m);
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 320; ++x)
      ASSERT_NEAR(registered.at<float>(y, x), depth_m.at<float>(y, x), 1e-6) << x << " " << y;
  }
}

TEST(DepthRegistrationTest, TheNearerSurfaceHidesTheFartherOne) {
  // A near patch before a far wall; from the colour camera, 10 cm to the side, the patch covers
  // wall that the depth camera saw.
  Pose T_color_depth = Pose::Identity();
  T_color_depth.translation() = Eigen::Vector3d(0.10, 0, 0);
  const Intrinsics camera{
      .width = 320, .height = 240, .fx = 260, .fy = 260, .cx = 159.5, .cy = 119.5};
  cv::Mat depth_m(240, 320, CV_32FC1, cv::Scalar(2.0));
  depth_m(cv::Rect(100, 80, 60, 60)).setTo(cv::Scalar(0.5));
  const cv::Mat registered = DepthRegistration(camera, camera, T_color_depth).Register(depth_m);
  // Disparities: 260 * 0.1 / 0.5 = 52 px for the patch, 13 px for the wall.
  for (int y = 82; y < 138; ++y) {
    for (int x = 154; x < 210; ++x)
      ASSERT_FLOAT_EQ(registered.at<float>(y, x), 0.5F) << x << " " << y;
  }
  EXPECT_FLOAT_EQ(registered.at<float>(110, 230), 2.0F);
  EXPECT_FLOAT_EQ(registered.at<float>(110, 130),
                  0.0F);  // wall that only the colour camera sees: nothing is known
}

TEST(DepthRegistrationTest, NothingStaysNothingAndBehindTheCameraIsDropped) {
  Pose T_color_depth = Pose::Identity();
  T_color_depth.translation() = Eigen::Vector3d(0, 0, -0.9);
  const Intrinsics camera = ColorCamera();
  EXPECT_EQ(cv::countNonZero(DepthRegistration(camera, camera, T_color_depth)
                                 .Register(cv::Mat::zeros(240, 320, CV_32FC1))),
            0);
  EXPECT_EQ(cv::countNonZero(DepthRegistration(camera, camera, T_color_depth)
                                 .Register(cv::Mat(240, 320, CV_32FC1, cv::Scalar(0.8)))),
            0);
}

TEST(DepthRegistrationTest, AnotherSizeOrTypeIsTheCallersMistake) {
  const DepthRegistration registration(DepthCamera(), ColorCamera(), BesideEachOther());
  EXPECT_THROW((void)registration.Register(cv::Mat(480, 640, CV_32FC1)), std::invalid_argument);
  EXPECT_THROW((void)registration.Register(cv::Mat(240, 320, CV_16UC1)), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
