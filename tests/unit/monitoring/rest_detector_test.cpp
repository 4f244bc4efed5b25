// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/rest_detector.hpp"

#include <gtest/gtest.h>

#include "algo/types/scene.hpp"

namespace plumb {
namespace {

constexpr double kLook_s = 0.25;

class RestDetectorTest : public ::testing::Test {
 protected:
  /// Markers 0 to num - 1; each corner `shift_px` beside its place. No two images have the same.
  SeenCorners See(int num, double shift_px) {
    noise_px_ = 0.03 - noise_px_;
    SeenCorners seen;
    for (int id = 0; id < num; ++id)
      for (std::size_t c = 0; c < 4; ++c)
        seen[id][c] = Eigen::Vector2d(100.0 * id + shift_px + noise_px_, 20.0 * double(c));
    return seen;
  }
  /// Looks for as long; whether the sensor was at rest at the end.
  bool Look(double seconds, int num, double shift_px = 0) {
    bool is_at_rest = false;
    for (double end_s = time_s_ + seconds; time_s_ < end_s - 1e-9;)
      is_at_rest = detector_.Add(time_s_ += kLook_s, See(num, shift_px));
    return is_at_rest;
  }

  static Scene FiveMarkers() {
    Scene scene;
    scene.room_markers = {.dictionary = kDefaultMarkerDictionary};
    for (int id = 0; id < 5; ++id) scene.markers[id] = {.corners = CornersInMarkerFrame(0.1)};
    return scene;
  }
  static Intrinsics Camera() {
    Intrinsics camera;
    camera.width = 640;
    camera.height = 480;
    return camera;
  }

  double time_s_ = 0, noise_px_ = 0.02;
  RestDetector detector_{FiveMarkers(), Camera()};
};

TEST_F(RestDetectorTest, IsAtRestAfterTwoSecondsAndNotBefore) {
  EXPECT_FALSE(Look(2.0, 4)) << "the first look begins the rest";
  EXPECT_TRUE(Look(kLook_s, 4));
  EXPECT_TRUE(Look(10, 4));
}

TEST_F(RestDetectorTest, NeedsFourMarkersOfTheScene) {
  EXPECT_FALSE(Look(5, 3));
  Scene others = FiveMarkers();
  others.markers.clear();
  RestDetector of_others(others, Camera());
  bool is_at_rest = false;
  for (int i = 0; i < 20; ++i) is_at_rest = is_at_rest || of_others.Add(i * kLook_s, See(5, 0));
  EXPECT_FALSE(is_at_rest) << "markers that the scene does not have";
}

TEST_F(RestDetectorTest, AHandIsNotAtRest) {
  ASSERT_TRUE(Look(3, 5));
  EXPECT_FALSE(Look(kLook_s, 5, 0.5)) << "a millimetre";
  EXPECT_TRUE(Look(2.25, 5, 0.5)) << "where it is now";
  EXPECT_TRUE(Look(kLook_s, 5, 0.7)) << "as a sensor that sways a little";
}

TEST_F(RestDetectorTest, ASlowDriftIsMeasuredFromTheBeginning) {
  ASSERT_TRUE(Look(3, 5));
  int restarts = 0;
  for (int i = 1; i <= 40; ++i) restarts += Look(kLook_s, 5, 0.1 * i) ? 0 : 1;
  EXPECT_GT(restarts, 10);
}

TEST_F(RestDetectorTest, RepeatedImagesAndGapsAreNoRest) {
  const SeenCorners frozen = See(5, 0);
  bool is_at_rest = false;
  for (int i = 0; i < 40; ++i) is_at_rest = is_at_rest || detector_.Add(time_s_ += kLook_s, frozen);
  EXPECT_FALSE(is_at_rest) << "a sensor that delivers one image again and again";
  ASSERT_TRUE(Look(3, 5));
  time_s_ += 1.5;
  EXPECT_FALSE(Look(kLook_s, 5)) << "nothing is known of the time between";
}

}  // namespace
}  // namespace plumb
