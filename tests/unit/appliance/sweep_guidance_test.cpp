// SPDX-License-Identifier: Apache-2.0
// Guidance over a flat table seen from above: areas, speeds and distances are known from geometry.
#include "daemon/sweep/sweep_guidance.hpp"

#include <gtest/gtest.h>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

constexpr Intrinsics kCamera{
    .width = 320, .height = 240, .fx = 260, .fy = 260, .cx = 159.5, .cy = 119.5};
constexpr double kFrame_s = 1.0 / 30;

Frame TableAt(double distance_m, double time_s) {
  Frame frame;
  frame.depth_time_s = time_s;
  frame.depth_m = cv::Mat(kCamera.height, kCamera.width, CV_32FC1, cv::Scalar(distance_m));
  return frame;
}

TrackingReport SeenFrom(double x_m, double distance_m) {
  TrackingReport report;
  report.tracked = true;
  report.num_markers = 2;
  report.median_depth_m = distance_m;
  report.valid_depth = 1.0;
  report.T_world_camera.translation() = Eigen::Vector3d(x_m, 0, 0);
  return report;
}

/// Moves along x over the table for some seconds.
SweepGuidance Sweep(SweepGuide& guide, double speed_m_s, double distance_m, double seconds,
                    double from_s = 0) {
  for (double t = 0; t < seconds; t += kFrame_s)
    guide.Add(TableAt(distance_m, from_s + t), SeenFrom(speed_m_s * t, distance_m));
  return guide.guidance();
}

TEST(SweepGuidanceTest, AreaIsThatOfTheTableThatWasSeen) {
  SweepGuide guide(kCamera);
  const SweepGuidance seen = Sweep(guide, 0.2, 0.9, 5.0);
  // The points taken span 304/260 * 0.9 by 224/260 * 0.9 m; the camera moved by 1 m along the
  // longer side. Cells of 5 cm round up.
  const double expected_m2 = (304.0 / 260 * 0.9 + 1.0) * (224.0 / 260 * 0.9);
  EXPECT_NEAR(seen.area_m2, expected_m2, 0.12 * expected_m2);
  EXPECT_EQ(seen.advice, SweepAdvice::kNone);
}

TEST(SweepGuidanceTest, SpeedIsMeasuredAndTooMuchOfItIsTold) {
  SweepGuide slow(kCamera), fast(kCamera);
  EXPECT_NEAR(Sweep(slow, 0.3, 0.9, 3.0).speed_m_s, 0.3, 0.01);
  EXPECT_EQ(slow.guidance().advice, SweepAdvice::kNone);
  EXPECT_NEAR(Sweep(fast, 1.2, 0.9, 3.0).speed_m_s, 1.2, 0.02);
  EXPECT_EQ(fast.guidance().advice, SweepAdvice::kSlower);
}

TEST(SweepGuidanceTest, TooNearTooFarAndBlindAreTold) {
  SweepGuide guide(kCamera);
  EXPECT_EQ(Sweep(guide, 0.1, 0.4, 0.2).advice, SweepAdvice::kFarther);
  EXPECT_EQ(Sweep(guide, 0.1, 1.6, 0.2, 1.0).advice, SweepAdvice::kCloser);
  TrackingReport blind = SeenFrom(0, 0);
  blind.median_depth_m = 0;
  blind.valid_depth = 0.05;
  EXPECT_EQ(guide.Add(TableAt(0, 2.0), blind).advice, SweepAdvice::kFarther)
      << "the sensor sees nothing when it is too near";
}

TEST(SweepGuidanceTest, LostTrackingIsToldAfterAMomentAndEndsWithTheNextPose) {
  SweepGuide guide(kCamera);
  Sweep(guide, 0.2, 0.9, 1.0);
  TrackingReport lost = SeenFrom(0, 0.9);
  lost.tracked = false;
  EXPECT_EQ(guide.Add(TableAt(0.9, 1.1), lost).advice, SweepAdvice::kNone);
  EXPECT_EQ(guide.Add(TableAt(0.9, 1.5), lost).advice, SweepAdvice::kTrackingLost);
  EXPECT_NE(guide.Add(TableAt(0.9, 1.6), SeenFrom(0.25, 0.9)).advice, SweepAdvice::kTrackingLost);
}

TEST(SweepGuidanceTest, ASweepThatSeesNoMarkersIsToldAndEndsWithTheNextMarker) {
  SweepGuide guide(kCamera);
  TrackingReport none = SeenFrom(0, 0.9);
  none.num_markers = 0;
  guide.Add(TableAt(0.9, 0.0), none);
  EXPECT_EQ(guide.Add(TableAt(0.9, 3.9), none).advice, SweepAdvice::kNone);
  EXPECT_EQ(guide.Add(TableAt(0.9, 4.1), none).advice, SweepAdvice::kNoMarkers)
      << "since the beginning";
  EXPECT_EQ(guide.Add(TableAt(0.9, 4.2), SeenFrom(0, 0.9)).advice, SweepAdvice::kNone);
  EXPECT_EQ(guide.Add(TableAt(0.9, 8.1), none).advice, SweepAdvice::kNone);
  EXPECT_EQ(guide.Add(TableAt(0.9, 8.3), none).advice, SweepAdvice::kNoMarkers);
  none.tracked = false;
  EXPECT_EQ(guide.Add(TableAt(0.9, 9.0), none).advice, SweepAdvice::kTrackingLost)
      << "the way back comes first";
}

TEST(SweepGuidanceTest, TimeWithoutNewCoverageRunsWhileTheCameraHoldsStillAndNotWhileItMoves) {
  SweepGuide guide(kCamera);
  EXPECT_LT(Sweep(guide, 0.2, 0.9, 4.0).without_new_surface_s, 0.5);
  for (double t = 4.0; t < 9.0; t += kFrame_s) guide.Add(TableAt(0.9, t), SeenFrom(0.8, 0.9));
  EXPECT_NEAR(guide.guidance().without_new_surface_s, 5.0, 0.6);
}

TEST(SweepGuidanceTest, LongSweepsWithTremblingHandsStillEnd) {
  SweepGuide guide(kCamera);
  unsigned random = 1;
  for (double t = 0; t < 12.0; t += kFrame_s) {
    random = random * 1664525U +
             1013904223U;  // a hand that shakes by some millimetres, and depth noise with it
    const double shake_m = (static_cast<double>(random >> 16) / 65536 - 0.5) * 6 * kMillimetre;
    guide.Add(TableAt(0.9 + shake_m, t), SeenFrom(shake_m, 0.9 + shake_m));
  }
  EXPECT_GT(guide.guidance().without_new_surface_s, 9.0);
}

}  // namespace
}  // namespace plumb
