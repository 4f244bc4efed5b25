// SPDX-License-Identifier: Apache-2.0
#include "algo/diagnosis/foreign_markers.hpp"

#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "tests/unit/markers/marker_scene.hpp"

namespace plumb {
namespace {

using Kind = ForeignMarkers::Kind;

// Two images of the same two markers.
std::vector<cv::Mat> Images(const char* dictionary) {
  const Intrinsics camera{640, 480, 527.0, 526.0, 318.3, 244.1, {}};
  std::mt19937 random(7);
  std::vector<cv::Mat> images;
  for (int i = 0; i < 2; ++i) {
    testing::PlacedMarker left{3}, right{7};
    for (auto* marker : {&left, &right}) {
      marker->T_camera_marker.linear() = RotationFromVector(Eigen::Vector3d(3.1415926, 0, 0));
      marker->T_camera_marker.translation() =
          Eigen::Vector3d(marker->id == 3 ? -0.2 : 0.2, 0.02 * i, 0.9);
    }
    images.push_back(
        testing::Render(MarkerDictionary::ByName(dictionary), {left, right}, camera, {}, random));
  }
  return images;
}

std::vector<cv::Mat> Each(const std::vector<cv::Mat>& images, auto change) {
  std::vector<cv::Mat> changed;
  for (const cv::Mat& image : images) changed.push_back(change(image));
  return changed;
}

TEST(ForeignMarkersTest, TellsMirroredInvertedAndOtherDictionariesApart) {
  const MarkerDictionary room = MarkerDictionary::ByName("DICT_6X6_250");
  const auto mirrored = Each(Images("DICT_6X6_250"), [](const cv::Mat& image) {
    cv::Mat flipped;
    cv::flip(image, flipped, 1);
    return flipped;
  });
  ASSERT_TRUE(FindForeignMarkers(mirrored, room));
  EXPECT_EQ(FindForeignMarkers(mirrored, room)->kind, Kind::kMirrored);
  const auto inverted =
      Each(Images("DICT_6X6_250"), [](const cv::Mat& image) { return cv::Mat(255 - image); });
  ASSERT_TRUE(FindForeignMarkers(inverted, room));
  EXPECT_EQ(FindForeignMarkers(inverted, room)->kind, Kind::kInverted);
  for (const char* name : {"DICT_4X4_50", "DICT_5X5_50", "DICT_APRILTAG_36h11"}) {
    const auto found = FindForeignMarkers(Images(name), room);
    ASSERT_TRUE(found) << name;
    EXPECT_EQ(found->kind, Kind::kOtherDictionary) << name;
    EXPECT_EQ(found->dictionary, name);
  }
}

TEST(ForeignMarkersTest, AnEmptyWallOrOneImageExplainsNothing) {
  const MarkerDictionary room = MarkerDictionary::ByName("DICT_6X6_250");
  const std::vector<cv::Mat> wall(3, cv::Mat(480, 640, CV_8UC1, cv::Scalar(128)));
  EXPECT_FALSE(FindForeignMarkers(wall, room));
  const std::vector<cv::Mat> one = {Images("DICT_4X4_50")[0]};
  EXPECT_FALSE(FindForeignMarkers(one, room)) << "a chance decoding does not repeat";
}

}  // namespace
}  // namespace plumb
