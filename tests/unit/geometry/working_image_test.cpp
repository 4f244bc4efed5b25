// SPDX-License-Identifier: Apache-2.0
#include "algo/geometry/working_image.hpp"

#include <stdexcept>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "algo/geometry/back_projection.hpp"

namespace plumb {
namespace {

Intrinsics OfWidth(int width) {
  Intrinsics camera;
  return Resized(camera, width, width * 3 / 4);
}

TEST(WorkingImageTest, HasAbout320ColumnsForEverySensorAndStaysAsItIs) {
  const std::vector<std::pair<int, int>> expected = {{160, 160}, {256, 256}, {320, 320}, {640, 320},
                                                     {848, 282}, {960, 320}, {1280, 320}};
  for (const auto& [width, columns] : expected) {
    const Intrinsics working = WorkingIntrinsics(OfWidth(width));
    EXPECT_EQ(working.width, columns);
    EXPECT_EQ(WorkingIntrinsics(working), working);
    const cv::Mat depth_m(working.height, working.width, CV_32FC1, cv::Scalar(1.0));
    EXPECT_EQ(WorkingDepth(depth_m, OfWidth(width), {}).data, depth_m.data);
  }
  EXPECT_THROW((void)WorkingBlock({640, 1, 500, 500, 320, 0, {}}), std::invalid_argument);
}

TEST(WorkingImageTest, APlaneStaysInItsPlace) {
  const Intrinsics image = OfWidth(640);
  const RayTable rays(image);
  const Eigen::Vector3f plane(0.5F, -0.8F, 1.1F);  // Its points have plane . p = 1.
  cv::Mat depth_m(image.height, image.width, CV_32FC1);
  for (int r = 0; r < image.height; ++r)
    for (int c = 0; c < image.width; ++c)
      depth_m.at<float>(r, c) = 1.0F / plane.dot(rays.ideal(r, c).homogeneous());
  const Intrinsics working = WorkingIntrinsics(image);
  const RayTable working_rays(working);
  const cv::Mat means_m = WorkingDepth(depth_m, image, {});
  for (int r = 0; r < working.height; ++r)
    for (int c = 0; c < working.width; ++c)
      ASSERT_NEAR(means_m.at<float>(r, c) * plane.dot(working_rays.ideal(r, c).homogeneous()), 1.0F,
                  2e-6F);
  EXPECT_EQ(InDepthImage({101, 42}, image, depth_m), Eigen::Vector2d(101, 42));
  EXPECT_EQ(InDepthImage({101, 42}, image, means_m), Eigen::Vector2d(50.25, 20.75));
}

TEST(WorkingImageTest, ABlockNeedsThreeQuartersOfItsPixelsOnOneSurface) {
  const Intrinsics image = OfWidth(640);
  cv::Mat depth_m(image.height, image.width, CV_32FC1, cv::Scalar(1.0));
  depth_m.at<float>(20, 40) = 0.0F;                              // One of four is missing,
  depth_m.at<float>(20, 60) = depth_m.at<float>(21, 61) = 0.0F;  // and two of four.
  const DepthNoise noise;
  const float step_m =
      EdgeStep_m(noise, 1.0F, static_cast<float>(1.0 / WorkingIntrinsics(image).fx));
  depth_m.at<float>(20, 80) = 1.0F + 0.9F * step_m;
  depth_m.at<float>(20, 100) = 1.0F + 1.1F * step_m;
  const cv::Mat means_m = WorkingDepth(depth_m, image, noise);
  EXPECT_EQ(means_m.at<float>(10, 20), 1.0F);
  EXPECT_EQ(means_m.at<float>(10, 30), 0.0F);
  EXPECT_GT(means_m.at<float>(10, 40), 1.0F);
  EXPECT_EQ(means_m.at<float>(10, 50), 0.0F) << "a depth edge";
}

TEST(WorkingImageTest, ColourIsThatOfTheMiddle) {
  // Of four, the lower right; the last two columns of 848 belong to no block.
  for (const int width : {960, 640, 848}) {
    const Intrinsics image = OfWidth(width);
    const int block = WorkingBlock(image);
    cv::Mat rgb(image.height, image.width, CV_8UC3, cv::Scalar(0, 0, 0));
    rgb.at<cv::Vec3b>(10 * block + block / 2, 20 * block + block / 2) = {1, 2, 3};
    const cv::Mat middles = WorkingColor(rgb, image);
    EXPECT_EQ(middles.cols, width / block);
    EXPECT_EQ(middles.at<cv::Vec3b>(10, 20), cv::Vec3b(1, 2, 3)) << width;
  }
}

TEST(WorkingImageTest, AnImageOfAnotherSizeOrTypeIsRefused) {
  const Intrinsics image = OfWidth(640);
  const auto depth = [&](int width, int height, int type) {
    return WorkingDepth(cv::Mat(height, width, type, cv::Scalar::all(1)), image, {});
  };
  EXPECT_EQ(depth(640, image.height, CV_32FC1).cols, 320);
  EXPECT_THROW((void)depth(640, image.height - 1, CV_32FC1), std::invalid_argument);
  EXPECT_THROW((void)depth(639, image.height, CV_32FC1), std::invalid_argument);
  EXPECT_THROW((void)depth(640, image.height, CV_16UC1), std::invalid_argument);
  EXPECT_THROW((void)WorkingDepth({}, image, {}), std::invalid_argument);
  EXPECT_THROW((void)WorkingColor(cv::Mat(image.height, 640, CV_8UC1), image),
               std::invalid_argument);
  EXPECT_THROW((void)WorkingColor(cv::Mat(image.height / 2, 640, CV_8UC3), image),
               std::invalid_argument);
}

}  // namespace
}  // namespace plumb
