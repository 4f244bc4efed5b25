// SPDX-License-Identifier: Apache-2.0
#include "algo/markers/corner_depth.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "algo/base/pose.hpp"

namespace plumb {
namespace {

Intrinsics Camera(int width) {
  Intrinsics intrinsics = Resized({}, width, width * 3 / 4);
  intrinsics.distortion = {0.06, -0.15, 0.001, -0.0005, 0.03};
  return intrinsics;
}

/// A marker of 104 mm on a plane that fills the image, tilted and off centre.
struct MarkerScene {
  Intrinsics intrinsics;
  DepthView view;
  MarkerObservation seen;
  MarkerCorners truth;  ///< camera frame

  explicit MarkerScene(int width) : intrinsics(Camera(width)) {
    Pose T_camera_marker = Pose::Identity();
    // z of the marker towards the camera (pi about x), then tilted.
    T_camera_marker.linear() = (Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY()) *
                                Eigen::AngleAxisd(EIGEN_PI - 0.3, Eigen::Vector3d::UnitX()) *
                                Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitZ()))
                                   .toRotationMatrix();
    T_camera_marker.translation() = Eigen::Vector3d(0.15, -0.1, 0.8);
    seen.id = 7;
    const MarkerCorners corners = CornersInMarkerFrame(0.104);
    for (std::size_t k = 0; k < 4; ++k) {
      truth[k] = T_camera_marker * corners[k];
      seen.corners[k] = Project(intrinsics, truth[k]);
    }
    view.intrinsics = intrinsics;
    view.depth_m = cv::Mat::zeros(intrinsics.height, intrinsics.width, CV_32FC1);
    const Eigen::Vector3d normal = T_camera_marker.linear().col(2);
    for (int row = 0; row < intrinsics.height; ++row)
      for (int column = 0; column < intrinsics.width; ++column) {
        const Eigen::Vector3d ray =
            Undistort(intrinsics, Eigen::Vector2d(column, row)).homogeneous();
        const double z = normal.dot(T_camera_marker.translation()) / normal.dot(ray);
        view.depth_m.at<float>(row, column) = static_cast<float>(z);
      }
  }
};

TEST(CornerDepthTest, TheWindowScalesWithTheImage) {
  EXPECT_EQ(DepthWindow(11, 640), 11);
  EXPECT_EQ(DepthWindow(11, 320), 5);
  EXPECT_EQ(DepthWindow(11, 1280), 23);
  EXPECT_EQ(DepthWindow(1, 320), 3);
  EXPECT_THROW((void)DepthWindow(0, 640), std::invalid_argument);
  EXPECT_THROW((void)DepthWindow(11, 0), std::invalid_argument);
}

TEST(CornerDepthTest, TheCornersOfCompleteDepthAreFound) {
  for (const int width : {640, 320}) {
    const MarkerScene scene(width);
    const auto corners = PaperCornerPositions(scene.seen, scene.view, RayTable(scene.intrinsics));
    for (std::size_t k = 0; k < 4; ++k) {
      ASSERT_TRUE(corners[k].has_value());
      // The depth is that of the pixel's centre, up to half a pixel from the corner: 0.7 px
      // x 1.5 mm x tan 28 deg.
      EXPECT_LT((*corners[k] - scene.truth[k]).norm(), width == 640 ? 0.8e-3 : 1.6e-3);
    }
  }
}

TEST(CornerDepthTest, MissingDepthPullsACornerSideways) {
  MarkerScene scene(640);
  // Depth is missing to the left of the left corners and at them, as where the projector's shadow
  // falls.
  const double edge = std::max(scene.seen.corners[0].x(), scene.seen.corners[3].x()) + 2.0;
  for (int row = 0; row < 480; ++row)
    for (int column = 0; column < static_cast<int>(edge); ++column)
      scene.view.depth_m.at<float>(row, column) = 0.0F;
  const auto corners = PaperCornerPositions(scene.seen, scene.view, RayTable(scene.intrinsics));
  const std::size_t left = scene.seen.corners[0].x() > scene.seen.corners[3].x() ? 0 : 3;
  ASSERT_TRUE(corners[left].has_value());
  EXPECT_GT((*corners[left] - scene.truth[left]).norm(), 4e-3);
}

TEST(CornerDepthTest, WithoutDepthOrOutsideTheImageThereIsNoCorner) {
  const MarkerScene scene(320);
  const RayTable rays(scene.intrinsics);
  DepthView empty = scene.view;
  empty.depth_m = cv::Mat::zeros(240, 320, CV_32FC1);
  for (const auto& position : PaperCornerPositions(scene.seen, empty, rays))
    EXPECT_FALSE(position.has_value());

  MarkerObservation outside = scene.seen;
  for (Eigen::Vector2d& corner : outside.corners) corner.x() += 1e9;
  for (const auto& position : PaperCornerPositions(outside, scene.view, rays))
    EXPECT_FALSE(position.has_value());
  MarkerObservation damaged = scene.seen;
  damaged.corners[2].y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(PaperCornerPositions(damaged, scene.view, rays)[2].has_value());

  DepthView wrong = scene.view;
  wrong.depth_m = cv::Mat::zeros(480, 640, CV_32FC1);
  EXPECT_THROW((void)PaperCornerPositions(scene.seen, wrong, rays), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
