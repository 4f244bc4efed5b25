#include "algo/markers/marker_detector.hpp"

#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace plumb {
namespace {

TEST(MarkerDetectorTest, RefusesImagesThatAreNone) {
  const MarkerDetector detector(MarkerDictionary::ByName("DICT_6X6_250"));
  EXPECT_THROW((void)detector.Detect(cv::Mat()), std::invalid_argument);
  EXPECT_THROW((void)detector.Detect(cv::Mat(0, 0, CV_8UC1)), std::invalid_argument);
  EXPECT_THROW((void)detector.Detect(cv::Mat(10, 10, CV_16UC1)), std::invalid_argument);
}

TEST(MarkerDetectorTest, FindsNothingInABlankImage) {
  const MarkerDetector detector(MarkerDictionary::ByName("DICT_6X6_250"));
  EXPECT_TRUE(detector.Detect(cv::Mat(480, 640, CV_8UC1, cv::Scalar(128))).markers.empty());
}

}  // namespace
}  // namespace plumb
