// SPDX-License-Identifier: Apache-2.0
#include "algo/diagnosis/depth_unit.hpp"

#include <cmath>
#include <random>
#include <utility>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/unit/markers/marker_scene.hpp"

namespace plumb {
namespace {

constexpr double kTrueDepth_m = 0.7;

/// Two markers 0.7 m away, again and again, whose depth is `factor` times the true one.
class TwoMarkers : public FrameSource {
 public:
  TwoMarkers(double taken, double factor, bool markers = true) {
    info_.intrinsics = {640, 480, 527.0, 526.0, 318.3, 244.1, {}};
    info_.depth_units_per_metre = taken;
    std::vector<testing::PlacedMarker> placed;
    for (const int id : {4, 9}) {
      testing::PlacedMarker& marker = placed.emplace_back(testing::PlacedMarker{id});
      marker.T_camera_marker.linear() = RotationFromVector(Eigen::Vector3d(M_PI, 0, 0));
      marker.T_camera_marker.translation() = Eigen::Vector3d(id == 4 ? -0.2 : 0.2, 0, kTrueDepth_m);
    }
    if (!markers) placed.clear();
    std::mt19937 random(1);
    const auto dictionary = MarkerDictionary::Find(info_.room_markers.dictionary).value();
    cv::cvtColor(testing::Render(dictionary, placed, info_.intrinsics, {}, random),
                 frame_.color_rgb, cv::COLOR_GRAY2RGB);
    frame_.depth_m = cv::Mat(480, 640, CV_32FC1, cv::Scalar(kTrueDepth_m * factor));
  }
  [[nodiscard]] const StreamInfo& info() const override { return info_; }
  [[nodiscard]] std::optional<Frame> Next() override {
    if (left_-- == 0) return std::nullopt;
    return frame_;
  }
  /// Depth of the right half of the image, metres.
  void SetRightHalf(double depth_m) { frame_.depth_m.colRange(320, 640).setTo(depth_m); }

 private:
  StreamInfo info_;
  Frame frame_;
  int left_ = 20;
};

TEST(DepthUnitTest, IsTheOneWithWhichDepthAgreesWithTheMarkers) {
  for (const double unit : {1000.0, 5000.0}) {
    for (const double taken : {1000.0, 5000.0}) {
      TwoMarkers source(taken, unit / taken);
      EXPECT_EQ(DepthUnitByMarkers(source), unit) << taken;
    }
  }
}

TEST(DepthUnitTest, PrintsAndSensorsThatAreOffDoNotHideIt) {
  for (const double off : {0.72, 0.94, 1.06, 1.28}) {
    TwoMarkers source(1000.0, 5.0 * off);
    EXPECT_EQ(DepthUnitByMarkers(source), 5000.0) << off;
  }
}

TEST(DepthUnitTest, WithoutAnAnswerNoneIsGiven) {
  for (const double factor : {0.5, 0.68, 1.32, 2.0, 3.4, 10.0}) {
    TwoMarkers between(1000.0, factor);
    EXPECT_EQ(DepthUnitByMarkers(between), std::nullopt) << "no unit is near " << factor;
  }
  TwoMarkers empty(1000.0, 5.0, false);
  EXPECT_EQ(DepthUnitByMarkers(empty), std::nullopt) << "no marker";
  TwoMarkers apart(1000.0, 1.0);
  apart.SetRightHalf(5 * kTrueDepth_m);
  EXPECT_EQ(DepthUnitByMarkers(apart), std::nullopt) << "the faces do not agree";
}

}  // namespace
}  // namespace plumb
