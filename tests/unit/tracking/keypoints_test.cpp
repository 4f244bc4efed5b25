// SPDX-License-Identifier: Apache-2.0
#include "algo/tracking/keypoints.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "algo/map/dense_view.hpp"

namespace plumb {
namespace {

using Eigen::Vector2d;
using Eigen::Vector2f;

// A smooth pattern known at every real place, so that images moved by fractions of a pixel are
// exact.
cv::Mat Pattern(double dx, double dy, int width = 320, int height = 240) {
  cv::Mat image(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double u = x - dx;
      const double v = y - dy;
      const double value =
          128 + 40 * std::sin(0.31 * u + 0.05 * v) * std::cos(0.27 * v - 0.04 * u) +
          30 * std::sin(0.11 * u - 0.13 * v) + 25 * std::cos(0.19 * v + 0.07 * u + 0.001 * u * v);
      image.at<unsigned char>(y, x) = cv::saturate_cast<unsigned char>(value);
    }
  }
  return image;
}

TEST(Keypoints, FollowsAShiftToAFractionOfAPixel) {
  const KeypointOptions options;
  const cv::Mat from = Pattern(0, 0);
  const double dx = 3.37;
  const double dy = -2.61;
  const auto corners = DetectCorners(from, {}, options);
  ASSERT_GT(corners.size(), 100U);
  const KltResult result =
      TrackKlt(MakePyramid(from, options), MakePyramid(Pattern(dx, dy), options), corners, corners,
               options.levels, options);
  std::vector<float> errors;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (!result.found[i]) continue;
    errors.push_back(
        (result.points[i] - corners[i] - Vector2f(static_cast<float>(dx), static_cast<float>(dy)))
            .norm());
  }
  ASSERT_GT(errors.size(), corners.size() * 8 / 10);
  std::sort(errors.begin(), errors.end());
  fmt::print("KLT: median {:.3f} px, 80 % below {:.3f} px\n", errors[errors.size() / 2],
             errors[errors.size() * 8 / 10]);
  EXPECT_LT(errors[errors.size() / 2], 0.05F);
  EXPECT_LT(errors[errors.size() * 8 / 10], 0.1F);
}

TEST(Keypoints, TheFirstPointOfEachCellIsChosen) {
  const KeypointOptions options{.cell_px = 40};
  // The third lies in the first one's cell, the fifth in the second's; the sixth beside the image.
  const std::vector<Vector2f> points = {{5, 5}, {40, 5}, {39, 39}, {5, 40}, {79, 0}, {700, 5}};
  EXPECT_EQ(FirstOfCells(points, 640, 480, options), (std::vector<std::size_t>{0, 1, 3}));
  // Cells are half as wide at half of the width.
  EXPECT_EQ(FirstOfCells({{5, 5}, {19, 5}, {20, 5}}, 320, 240, options),
            (std::vector<std::size_t>{0, 2}));
}

TEST(Keypoints, FollowsThroughAChangeOfTheExposureOnceItsRatioIsKnown) {
  const KeypointOptions options;
  const cv::Mat from = Pattern(0, 0);
  const cv::Mat darker = Pattern(1.3, -0.6) * 0.6;
  const auto corners = DetectCorners(from, {}, options);
  const double ratio = BrightnessRatio(from, darker, corners, corners);
  EXPECT_NEAR(ratio, 0.6, 0.03);  // The pattern moved a little too.
  const auto found = [&](const cv::Mat& start) {
    const KltResult result = TrackKlt(MakePyramid(start, options), MakePyramid(darker, options),
                                      corners, corners, options.levels, options);
    return static_cast<std::size_t>(std::count(result.found.begin(), result.found.end(), true));
  };
  EXPECT_LT(found(from), corners.size() / 2) << "the change does no harm: nothing is tested";
  EXPECT_GT(found(from * ratio), corners.size() * 8 / 10);
  EXPECT_EQ(BrightnessRatio(from, darker, {corners[0]}, {corners[0]}), 1.0)
      << "one point is not enough";
}

TEST(Keypoints, LosesWhatIsNoLongerThere) {
  const KeypointOptions options;
  const cv::Mat from = Pattern(0, 0);
  const auto corners = DetectCorners(from, {}, options);
  const cv::Mat black = cv::Mat::zeros(from.size(), CV_8UC1);
  const KltResult result = TrackKlt(MakePyramid(from, options), MakePyramid(black, options),
                                    corners, corners, options.levels, options);
  for (std::size_t i = 0; i < corners.size(); ++i) EXPECT_FALSE(result.found[i]);
}

TEST(Keypoints, OneCornerACellAndNoneWhereOneIs) {
  const KeypointOptions options;
  const cv::Mat image = Pattern(0, 0);
  const auto corners = DetectCorners(image, {}, options);
  const int cell = 16;  // 32 at 640 columns.
  std::vector<int> count(20 * 15, 0);
  for (const Vector2f& p : corners)
    ++count[static_cast<std::size_t>(static_cast<int>(std::lround(p.y())) / cell * 20 +
                                     static_cast<int>(std::lround(p.x())) / cell)];
  for (const int n : count) EXPECT_LE(n, 2);  // Two where a peak lies on the cells' border.
  const auto again = DetectCorners(image, corners, options);
  EXPECT_LT(again.size(), corners.size() / 5);
}

TEST(Keypoints, FindsACornerWhereItIs) {
  cv::Mat image(240, 320, CV_8UC1, cv::Scalar(60));
  image(cv::Rect(100, 80, 220, 160)).setTo(180);  // Its corner is at pixel border (99.5, 79.5).
  const auto corners = DetectCorners(image, {}, {});
  double nearest = 1e9;
  for (const Vector2f& p : corners)
    nearest = std::min<double>(nearest, (p - Vector2f(99.5F, 79.5F)).norm());
  // The score's window pulls the peak inwards a little.
  EXPECT_LT(nearest, 1.5);
}

TEST(Keypoints, FlatImagesHaveNoCorners) {
  EXPECT_TRUE(DetectCorners(cv::Mat(240, 320, CV_8UC1, cv::Scalar(90)), {}, {}).empty());
}

TEST(Keypoints, DepthIsTheMedianAndNothingAtEdgesAndHoles) {
  cv::Mat depth(20, 20, CV_32FC1, cv::Scalar(0.8));
  depth.at<float>(10, 10) = 0.81F;
  EXPECT_FLOAT_EQ(static_cast<float>(DepthAt(depth, {10, 10})), 0.8F);
  depth(cv::Rect(12, 0, 8, 20)).setTo(1.2);
  EXPECT_EQ(DepthAt(depth, {11.6, 10}), 0.0) << "an edge";
  cv::Mat holes = cv::Mat::zeros(20, 20, CV_32FC1);
  holes.at<float>(5, 5) = 0.9F;
  EXPECT_EQ(DepthAt(holes, {5, 5}), 0.0) << "too little around";
  for (const Vector2d& outside :
       {Vector2d(-3, 5), Vector2d(0, 0), Vector2d(25, 5), Vector2d(5, 19), Vector2d(1e9, -1e9)})
    EXPECT_EQ(DepthAt(depth, outside), 0.0);
}

TEST(Keypoints, SurfaceDepthIsThatOfThePlaneAtTheVeryPixel) {
  // Inverse depth grows by 0.02 a pixel: from pixel to pixel depth changes by 1.3 %.
  cv::Mat depth(40, 40, CV_32FC1);
  const auto z_at = [](double x, double y) {
    return 1.0 / (1.5 + 0.02 * (x - 20) - 0.01 * (y - 20));
  };
  for (int r = 0; r < 40; ++r)
    for (int c = 0; c < 40; ++c) depth.at<float>(r, c) = static_cast<float>(z_at(c, r));
  const SurfaceDepth found = SurfaceDepthAt(depth, {20.4, 18.7});
  EXPECT_NEAR(found.z_m, z_at(20.4, 18.7), 1e-6);
  EXPECT_NEAR(found.inverse_slope.x(), 0.02, 1e-6);
  EXPECT_NEAR(found.inverse_slope.y(), -0.01, 1e-6);
  EXPECT_GT(std::abs(DepthAt(depth, {20.4, 18.7}) - z_at(20.4, 18.7)), 0.001);
}

TEST(Keypoints, SurfaceDepthIsNothingWhereAWindowCoversAnEdge) {
  cv::Mat depth(60, 60, CV_32FC1, cv::Scalar(0.8));
  depth(cv::Rect(40, 0, 20, 60)).setTo(0.9);
  EXPECT_NEAR(SurfaceDepthAt(depth, {33, 30}).z_m, 0.8, 1e-6);
  EXPECT_EQ(SurfaceDepthAt(depth, {34, 30}).z_m, 0.0) << "the edge is 6 pixels away";
  EXPECT_GT(DepthAt(depth, {34, 30}), 0.0);
  // 1.4 % of inverse depth are the limit at 0.8 m.
  depth(cv::Rect(40, 0, 20, 60)).setTo(0.8 * 1.013);
  EXPECT_GT(SurfaceDepthAt(depth, {34, 30}).z_m, 0.0) << "relief and noise";
  depth(cv::Rect(40, 0, 20, 60)).setTo(0.8 * 1.015);
  EXPECT_EQ(SurfaceDepthAt(depth, {34, 30}).z_m, 0.0);
  for (const Vector2d& outside :
       {Vector2d(-3, 5), Vector2d(5, 30), Vector2d(55, 30), Vector2d(1e9, -1e9)})
    EXPECT_EQ(SurfaceDepthAt(depth, outside).z_m, 0.0);
  cv::Mat holes = cv::Mat::zeros(60, 60, CV_32FC1);
  holes(cv::Rect(28, 28, 5, 3)).setTo(0.9);
  EXPECT_EQ(SurfaceDepthAt(holes, {30, 30}).z_m, 0.0) << "15 of 25 neighbours";
  holes(cv::Rect(28, 28, 5, 4)).setTo(0.9);
  EXPECT_NEAR(SurfaceDepthAt(holes, {30, 30}).z_m, 0.9, 1e-6) << "20 of 25";
}

TEST(DenseView, PlaneHasItsNormalAndDepth) {
  Intrinsics k;
  // n . p = 0.6 with the plane tilted about both axes.
  const Eigen::Vector3d n = Eigen::Vector3d(0.2, -0.15, 1).normalized();
  cv::Mat depth(480, 640, CV_32FC1);
  for (int r = 0; r < 480; ++r)
    for (int c = 0; c < 640; ++c)
      depth.at<float>(r, c) =
          static_cast<float>(0.6 / n.dot(Eigen::Vector3d((c - k.cx) / k.fx, (r - k.cy) / k.fy, 1)));
  depth(cv::Rect(200, 200, 40, 40)).setTo(0);
  const DenseView view = DenseViewMaker(k).Make(depth);
  ASSERT_EQ(view.width, 160);
  ASSERT_EQ(view.height, 120);
  int with_normal = 0;
  for (std::size_t i = 0; i < view.size(); ++i) {
    if (view.normals[i].isZero()) continue;
    ++with_normal;
    EXPECT_LT((view.normals[i].cast<double>() + n).norm(), 1e-3);  // Towards the camera.
    EXPECT_NEAR(n.dot(view.point(i).cast<double>()), 0.6, 1e-5);
  }
  EXPECT_GT(with_normal, 160 * 120 - 12 * 12 - 2 * (160 + 120) - 1);
  EXPECT_EQ(view.z_m[55 * 160 + 55], 0.0F) << "the hole";
}

TEST(DenseView, OfAFrameHasTheSameDepthInTheCellsOfItsPose) {
  Intrinsics k;
  cv::Mat depth(480, 640, CV_32FC1);
  for (int r = 0; r < 480; ++r)
    for (int c = 0; c < 640; ++c)
      depth.at<float>(r, c) =
          0.5F + 0.001F * static_cast<float>(c) + 0.0003F * static_cast<float>(r);
  depth(cv::Rect(322, 0, 10, 480)).setTo(0);
  const DenseViewMaker maker(k);
  const DenseView whole = maker.Make(depth);
  const DenseView of_frame = maker.MakeForPose(depth);
  ASSERT_EQ(of_frame.size(), whole.size());
  for (int r = 0; r < whole.height; r += kPoseStride) {
    for (int c = 0; c < whole.width; c += kPoseStride) {
      const auto i = static_cast<std::size_t>(r * whole.width + c);
      EXPECT_EQ(of_frame.z_m[i], whole.z_m[i]) << r << ", " << c;
    }
  }
}

TEST(DenseView, EdgesAreLeftOut) {
  Intrinsics k;
  cv::Mat depth(480, 640, CV_32FC1, cv::Scalar(0.7));
  depth(cv::Rect(322, 0, 318, 480)).setTo(1.0);  // In the middle of a 4-pixel window.
  const DenseView view = DenseViewMaker(k).Make(depth);
  EXPECT_EQ(view.z_m[60 * 160 + 80], 0.0F);
  EXPECT_NEAR(view.z_m[60 * 160 + 79], 0.7F, 1e-6);
  EXPECT_TRUE(view.normals[60 * 160 + 79].isZero()) << "no normal across an edge";
}

TEST(DepthSigma, FollowsNguyen) {
  EXPECT_NEAR(DepthSigma({}, 0.4, 1.0), 0.0012, 1e-9);
  EXPECT_NEAR(DepthSigma({}, 1.4, 1.0), 0.0031, 1e-9);
  // theta = 60 degrees: 0.0001 / sqrt(1) * (60 / 30)^2 more.
  EXPECT_NEAR(DepthSigma({}, 1.0, 0.5), 0.0012 + 0.0019 * 0.36 + 0.0004, 1e-9);
  EXPECT_TRUE(std::isfinite(DepthSigma({}, 1.0, 0.0)));
  EXPECT_TRUE(std::isfinite(DepthSigma({}, 0.0, 1.0)));
}

}  // namespace
}  // namespace plumb
