// SPDX-License-Identifier: Apache-2.0
// Which live frames are left out: the decision on both sides of each limit, and a whole sweep under
// a clock of the test.
#include "daemon/pipeline/frame_thinning.hpp"

#include <algorithm>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "words/reconstruction.hpp"

namespace plumb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kPeriod_s = 1.0 / 30;

// Load is what all frames would need of the time.
TrackingLoad Load(double load, double late_s, double since_change_s) {
  return {.frame_period_s = kPeriod_s,
          .tracking_s = load * kPeriod_s,
          .late_s = late_s,
          .since_change_s = since_change_s};
}

TEST(NextStride, LeavesMoreOutOnceTrackingIsLateAndCannotCatchUp) {
  EXPECT_EQ(NextStride(1, Load(1.2, 0.149, 5)), 1) << "not late yet";
  EXPECT_EQ(NextStride(1, Load(1.2, 0.150, 5)), 2);
  EXPECT_EQ(NextStride(1, Load(0.84, 0.3, 5)), 1) << "catches up by itself";
  EXPECT_EQ(NextStride(1, Load(0.86, 0.3, 5)), 2);
  EXPECT_EQ(NextStride(2, Load(1.69, 0.3, 5)), 2) << "the same at every second frame";
  EXPECT_EQ(NextStride(2, Load(1.71, 0.3, 5)), 3);
}

TEST(NextStride, LeavesSoManyOutThatTheRestIsInTime) {
  EXPECT_EQ(NextStride(1, Load(1.69, 0.2, 5)), 2) << "two times 0.85";
  EXPECT_EQ(NextStride(1, Load(1.71, 0.2, 5)), 3);
  EXPECT_EQ(NextStride(1, Load(9.0, 0.2, 5)), 4) << "at least a quarter is tracked";
  EXPECT_EQ(NextStride(4, Load(9.0, 0.4, 5)), 4);
}

TEST(NextStride, WaitsAfterAChange) {
  EXPECT_EQ(NextStride(2, Load(3.0, 0.3, 0.24)), 2);
  EXPECT_EQ(NextStride(2, Load(3.0, 0.3, 0.25)), 4);
  EXPECT_EQ(NextStride(2, Load(0.3, 0.0, 1.99)), 2);
  EXPECT_EQ(NextStride(2, Load(0.3, 0.0, 2.0)), 1);
}

TEST(NextStride, TakesMoreAgainOnlyWhereThatStaysInTime) {
  EXPECT_EQ(NextStride(2, Load(0.69, 0.0, 5)), 1);
  EXPECT_EQ(NextStride(2, Load(0.71, 0.0, 5)), 2);
  EXPECT_EQ(NextStride(4, Load(2.09, 0.0, 5)), 3) << "one step at a time";
  EXPECT_EQ(NextStride(4, Load(2.11, 0.0, 5)), 4);
  EXPECT_EQ(NextStride(2, Load(0.3, 0.070, 5)), 1);
  EXPECT_EQ(NextStride(2, Load(0.3, 0.071, 5)), 2) << "not in time yet";
  EXPECT_EQ(NextStride(1, Load(0.3, 0.0, 5)), 1);
}

TEST(NextStride, StaysWhileNothingIsKnown) {
  EXPECT_EQ(NextStride(3, {.late_s = 9, .since_change_s = 9}), 3);
  EXPECT_EQ(NextStride(1, {.frame_period_s = kPeriod_s, .late_s = 9, .since_change_s = 9}), 1);
}

/// A sensor of 30 frames a second and tracking that takes its time, both under one clock. Fifteen
/// frames may wait; the oldest are lost then.
class Sensor : public FrameFeed {
 public:
  /// @param stamps_per_s  How fast its clock goes.
  Sensor(int num_frames, double stamps_per_s)
      : num_frames_(num_frames), stamps_per_s_(stamps_per_s) {}
  double now_s = 0.0;
  double set_by_s = 0.0;  ///< By how much its clock is set at the hundredth frame.

  std::optional<Frame> Next(const std::stop_token&) override {
    if (next_ == num_frames_) return std::nullopt;
    now_s = std::max(now_s, ArrivalOf(next_));
    while (ArrivalOf(next_ + 15) <= now_s && next_ + 1 < num_frames_) {
      ++next_;
      ++lost_;
      ++lost_in_all;
    }
    Frame frame;
    frame.index = next_++;
    frame.depth_time_s = 77.0 + static_cast<double>(frame.index) * kPeriod_s * stamps_per_s_;
    if (frame.index >= 100) frame.depth_time_s += set_by_s;
    taken_arrived_s_ = ArrivalOf(static_cast<int>(frame.index));
    return frame;
  }
  int TakeDropped() override { return std::exchange(lost_, 0); }
  void Finish() override {}
  std::optional<double> last_frame_s() const override { return std::nullopt; }
  std::optional<double> taken_arrived_s() const override { return taken_arrived_s_; }

  int lost_in_all = 0;

 private:
  static double ArrivalOf(int frame) { return frame * kPeriod_s + 0.01; }
  const int num_frames_;
  const double stamps_per_s_;
  int next_ = 0, lost_ = 0;
  double taken_arrived_s_ = 0.0;
};

struct Sweep {
  std::vector<std::int64_t> taken;
  std::vector<bool> with_fewer;  // Of each frame in `taken`.
  int lost = 0, dropped = 0;
  std::vector<std::string> warnings;  // Of a scene that said how many were dropped.
};

/// @param tracking_s  That a frame takes, by its index.
/// @param share_of_fewer  By how much of that with fewer keypoints.
Sweep Track(int num_frames, const std::function<double(std::int64_t)>& tracking_s,
            double share_of_fewer = 1.0, double stamps_per_s = 1.0) {
  Sensor sensor(num_frames, stamps_per_s);
  ThinnedFeed feed(sensor, [&] { return sensor.now_s; });
  Sweep sweep;
  while (const std::optional<Frame> frame = feed.Next({})) {
    sweep.taken.push_back(frame->index);
    sweep.with_fewer.push_back(frame->fewer_keypoints);
    sensor.now_s += tracking_s(frame->index) * (frame->fewer_keypoints ? share_of_fewer : 1.0);
    sweep.dropped += feed.TakeDropped();
  }
  sweep.dropped += feed.TakeDropped();
  sweep.lost = sensor.lost_in_all;
  Scene scene;
  scene.frames_dropped = sweep.dropped;
  scene.frames_total = num_frames;
  scene.warnings.push_back(say::reconstruction::FramesDropped(sweep.dropped, num_frames));
  feed.WarnIn(scene);
  sweep.warnings = EnglishTexts(scene.warnings);
  return sweep;
}

// Of 300 frames: 5 % are 15.
TEST(ThinnedFeed, OfFramesLeftOutOnlySoManyLostOnesAreTold) {
  Sensor sensor(300, 1.0);
  ThinnedFeed feed(sensor, [&] { return sensor.now_s; });
  int left_out = 0;
  while (feed.Next({})) {
    sensor.now_s += 0.08;
    left_out += feed.TakeDropped();
  }
  left_out += feed.TakeDropped() - sensor.lost_in_all;
  ASSERT_GT(left_out, 0);
  const auto told = [&](int lost) {
    Scene scene;
    scene.frames_total = 300;
    scene.frames_dropped = left_out + lost;
    scene.warnings = {say::reconstruction::FramesDropped(scene.frames_dropped, 300)};
    feed.WarnIn(scene);
    return EnglishTexts(scene.warnings);
  };
  EXPECT_THAT(told(15), ElementsAre(HasSubstr(fmt::format("{} of 300", left_out))));
  EXPECT_THAT(told(16), ElementsAre(HasSubstr("16 of 300"), HasSubstr("of 300")));
}

TEST(ThinnedFeed, TakesEveryFrameOfASweepThatIsTrackedInTime) {
  // Every fifth is a keyframe and late by itself.
  const Sweep sweep = Track(300, [](std::int64_t i) { return i % 5 == 0 ? 0.06 : 0.02; });
  EXPECT_EQ(sweep.taken.size(), 300U);
  EXPECT_EQ(sweep.dropped, 0);
  EXPECT_THAT(sweep.warnings, ElementsAre(HasSubstr("dropped")));
  EXPECT_EQ(std::count(sweep.with_fewer.begin(), sweep.with_fewer.end(), true), 0);
}

TEST(ThinnedFeed, FewerKeypointsSaveFramesWhereTheyAreEnough) {
  // 35 ms of the 33 ms between two frames, and 25 ms with fewer keypoints.
  const Sweep sweep = Track(
      300, [](std::int64_t) { return 0.035; }, 0.7);
  EXPECT_EQ(sweep.taken.size(), 300U);
  EXPECT_THAT(sweep.warnings, ElementsAre(HasSubstr("dropped")));
  const auto fewer = std::count(sweep.with_fewer.begin(), sweep.with_fewer.end(), true);
  EXPECT_GT(fewer, 200);
  EXPECT_LT(fewer, 270) << "they are reduced once tracking is late, not before";
  EXPECT_TRUE(sweep.with_fewer.back()) << "a load of 0.75 is too much for all of them";
  // Without a saving, frames are skipped as well.
  EXPECT_LT(Track(300, [](std::int64_t) { return 0.035; }).taken.size(), 300U);
}

TEST(ThinnedFeed, UsesAllKeypointsAgainWhenTheLoadIsOver) {
  const Sweep sweep = Track(
      600, [](std::int64_t i) { return i < 150 ? 0.036 : 0.010; }, 0.7);
  EXPECT_EQ(sweep.taken.size(), 600U);
  EXPECT_TRUE(sweep.with_fewer[149]);
  EXPECT_FALSE(sweep.with_fewer.back());
  // Once each way.
  int changes = 0;
  for (std::size_t i = 1; i < sweep.with_fewer.size(); ++i)
    changes += sweep.with_fewer[i] != sweep.with_fewer[i - 1] ? 1 : 0;
  EXPECT_EQ(changes, 2);
}

TEST(ThinnedFeed, LeavesOutEvenlyAndLosesNoneWhereTrackingTakesTooLong) {
  const Sweep sweep = Track(300, [](std::int64_t i) { return i % 5 == 0 ? 0.09 : 0.04; });
  EXPECT_EQ(sweep.lost, 0) << "none in a row";
  EXPECT_EQ(sweep.taken.size() + static_cast<std::size_t>(sweep.dropped), 300U);
  EXPECT_NEAR(static_cast<double>(sweep.taken.size()), 155, 15);
  for (std::size_t i = 61; i < sweep.taken.size(); ++i)
    EXPECT_EQ(sweep.taken[i] - sweep.taken[i - 1], 2) << "before " << sweep.taken[i];
  EXPECT_THAT(sweep.warnings, ElementsAre(HasSubstr("of 300 frames were left out evenly")))
      << "of the same frames it is not said that they were dropped";
}

TEST(ThinnedFeed, TheRateOfTheStampsClockDoesNotMatter) {
  for (const double stamps_per_s : {0.25, 4.0}) {
    const auto track = [&](double tracking_s, double rate) {
      return Track(
          300, [&](std::int64_t) { return tracking_s; }, 1.0, rate);
    };
    EXPECT_EQ(track(0.025, stamps_per_s).taken.size(), 300U) << stamps_per_s;
    EXPECT_EQ(track(0.05, stamps_per_s).taken, track(0.05, 1.0).taken) << stamps_per_s;
  }
}

TEST(ThinnedFeed, AClockThatIsSetDoesNotMatter) {
  for (const double set_by_s : {0.0, 3600.0, -3600.0}) {
    Sensor sensor(300, 1.0);
    sensor.set_by_s = set_by_s;
    ThinnedFeed feed(sensor, [&] { return sensor.now_s; });
    int taken = 0;
    // One frame makes tracking late, which it can make up for.
    for (; const std::optional<Frame> frame = feed.Next({}); ++taken)
      sensor.now_s += frame->index == 200 ? 0.25 : 0.012;
    EXPECT_EQ(taken, 300) << set_by_s;
  }
}

TEST(ThinnedFeed, TakesAllAgainWhenTheLoadIsOver) {
  const Sweep sweep = Track(600, [](std::int64_t i) { return i < 150 ? 0.05 : 0.01; });
  EXPECT_EQ(sweep.lost, 0);
  EXPECT_EQ(sweep.taken.back(), 599);
  EXPECT_EQ(sweep.taken[sweep.taken.size() - 100], 500) << "the last ones without a gap";
}

TEST(ThinnedFeed, BeyondWhatItMayLeaveOutTheQueueLosesFramesAndTheyAreCounted) {
  const Sweep sweep = Track(300, [](std::int64_t) { return 0.4; });
  EXPECT_GT(sweep.lost, 50);
  EXPECT_THAT(sweep.warnings,
              ElementsAre(HasSubstr(fmt::format("{} of 300 frames were dropped", sweep.lost)),
                          HasSubstr(fmt::format("{} of 300 frames were left out evenly",
                                                sweep.dropped - sweep.lost))));
  EXPECT_EQ(sweep.taken.size() + static_cast<std::size_t>(sweep.dropped), 300U);
}

}  // namespace
}  // namespace plumb
