// SPDX-License-Identifier: Apache-2.0
#include "algo/tracking/tracker.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "algo/base/errors.hpp"
#include "algo/geometry/working_image.hpp"
#include "tests/unit/tracking/ball_sweep.hpp"

namespace plumb {
namespace {

constexpr int kNumFrames = 20;

class TrackerTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { sweep_ = new BallSweep(MakeBallSweep(kNumFrames)); }
  static void TearDownTestSuite() { delete sweep_; }
  static const BallSweep& sweep() { return *sweep_; }

  // Farthest that a tracked frame's camera is from its true place, both in the first frame's
  // camera.
  static double WorstError(const Tracker& tracker, std::size_t first = 0) {
    double worst = 0;
    for (const TrackedFrame& frame : tracker.frames()) {
      if (!frame.tracked) continue;
      const Pose T_true = sweep().T_world_color[first].inverse() *
                          sweep().T_world_color[static_cast<std::size_t>(frame.frame_index)];
      worst =
          std::max(worst, (T_true.inverse() * tracker.T_world_color(frame)).translation().norm());
    }
    return worst;
  }

  static BallSweep* sweep_;
};
BallSweep* TrackerTest::sweep_ = nullptr;

struct Case {
  const char* name;
  TrackerOptions options;
  double tolerance_m;
  std::size_t first = 0;
  std::size_t end = kNumFrames;
};

TEST_F(TrackerTest, FollowsASweepWithAnyOfItsMeans) {
  // Measured: 0.5, 1.8, 0.3, 0.5 and 0.7 mm. Markers alone: only while the map's own markers are in
  // sight.
  const Case cases[] = {
      {"all", {}, 0.001},
      {"markers and depth", {.use_keypoints = false}, 0.003},
      {"markers only", {.use_keypoints = false, .use_dense = false}, 0.003, 9, 17},
      {"keypoints and depth", {.use_markers = false}, 0.0015},
      {"keypoints only", {.use_markers = false, .use_dense = false}, 0.0015}};
  for (const Case& c : cases) {
    Tracker tracker(sweep().info, c.options);
    std::size_t tracked = 0;
    for (std::size_t i = c.first; i < c.end; ++i)
      tracked += tracker.Track(sweep().frames[i]).tracked ? 1U : 0U;
    const double worst = WorstError(tracker, c.first);
    fmt::print("{}: {} of {} frames, worst {:.2e} m, {} keyframes, {} landmarks, {} markers\n",
               c.name, tracked, c.end - c.first, worst, tracker.map().keyframes.size(),
               tracker.map().landmarks.size(), tracker.map().markers.size());
    EXPECT_EQ(tracked, c.end - c.first) << c.name;
    EXPECT_LT(worst, c.tolerance_m) << c.name;
    EXPECT_GE(tracker.map().keyframes.size(), 3U) << c.name;
    EXPECT_EQ(tracker.map().markers.empty(), !c.options.use_markers) << c.name;
    EXPECT_EQ(tracker.map().landmarks.empty(), !c.options.use_keypoints) << c.name;
  }
}

// Keypoints are observed in the newest keyframe only, so that the others need no more than the
// surface does.
TEST_F(TrackerTest, KeepsAllButTheNewestKeyframeAtWorkingResolution) {
  const BallSweep large = MakeBallSweep(12, 640);
  Tracker whole(large.info, {}), working(large.info, {.keep_working_images = true});
  for (const Frame& frame : large.frames) {
    const TrackedFrame a = whole.Track(frame), b = working.Track(frame);
    EXPECT_TRUE(b.tracked);
    EXPECT_TRUE(whole.T_world_color(a).isApprox(working.T_world_color(b), 0.0));
  }
  const auto& keyframes = working.map().keyframes;
  ASSERT_EQ(keyframes.size(), whole.map().keyframes.size());
  ASSERT_GE(keyframes.size(), 3U);
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    const cv::Mat& depth_m = whole.map().keyframes[k].data.view.depth_m;
    EXPECT_EQ(depth_m.size(), cv::Size(640, 480));
    const cv::Mat kept = k + 1 < keyframes.size()
                             ? WorkingDepth(depth_m, large.info.intrinsics, large.info.depth_noise)
                             : depth_m;
    const DepthView& view = keyframes[k].data.view;
    ASSERT_EQ(view.depth_m.size(), kept.size()) << k;
    EXPECT_EQ(cv::norm(view.depth_m, kept, cv::NORM_INF), 0) << k;
    EXPECT_EQ(view.color_rgb.size(), cv::Size(320, 240)) << k;
  }
}

TEST_F(TrackerTest, FollowsThroughAStepOfTheExposure) {
  Tracker tracker(sweep().info, {.use_markers = false, .use_dense = false});
  for (std::size_t i = 0; i < sweep().frames.size(); ++i) {
    Frame frame = sweep().frames[i];
    if (i >= 6) frame.color_rgb = frame.color_rgb * (i < 13 ? 0.5 : 0.8);
    EXPECT_TRUE(tracker.Track(frame).tracked) << "frame " << i;
  }
  const double worst = WorstError(tracker);
  fmt::print("exposure halved, and back: worst {:.2e} m\n", worst);
  EXPECT_LT(worst, 0.002);
}

TEST_F(TrackerTest, FollowsWithFewerKeypointsToo) {
  Tracker all(sweep().info, {}), fewer(sweep().info, {}), at_first(sweep().info, {});
  double num_all = 0, num_fewer = 0;
  for (std::size_t i = 0; i < kNumFrames; ++i) {
    num_all += all.Track(sweep().frames[i]).num_keypoints;
    Frame marked = sweep().frames[i];
    marked.fewer_keypoints = true;
    const TrackedFrame result = fewer.Track(marked);
    EXPECT_TRUE(result.tracked) << "frame " << i;
    EXPECT_TRUE(result.fewer_keypoints);
    num_fewer += result.num_keypoints;
    (void)at_first.Track(i < kNumFrames / 2 ? marked : sweep().frames[i]);
  }
  fmt::print("{:.0f} keypoints instead of {:.0f}, worst {:.2e} m\n", num_fewer, num_all,
             WorstError(fewer));
  EXPECT_LT(num_fewer, 0.6 * num_all);
  EXPECT_LT(WorstError(fewer), 0.001);
  EXPECT_LT(WorstError(at_first), 0.001);
  // Their number grows again once all may be followed.
  EXPECT_GT(at_first.frames().back().num_keypoints, 1.3 * fewer.frames().back().num_keypoints);
  EXPECT_FALSE(at_first.frames().back().fewer_keypoints);
}

TEST_F(TrackerTest, FollowsThroughAFrameThatWasStampedLate) {
  const double spacing_s = sweep().frames[1].color_time_s - sweep().frames[0].color_time_s;
  for (const double before_next_s : {0.2 * spacing_s, 0.001}) {
    Tracker tracker(sweep().info, {});
    for (std::size_t i = 0; i < sweep().frames.size(); ++i) {
      Frame frame = sweep().frames[i];
      if (i == 9) {
        frame.color_time_s += spacing_s - before_next_s;
        frame.depth_time_s += spacing_s - before_next_s;
      }
      const TrackedFrame result = tracker.Track(frame);
      EXPECT_TRUE(result.tracked) << "frame " << i;
      EXPECT_GE(result.num_keypoints + result.num_markers, i == 0 ? 0 : 12) << "frame " << i;
    }
    const double worst = WorstError(tracker);
    fmt::print("{:.0f} ms before the next: worst {:.2e} m\n", 1000 * before_next_s, worst);
    EXPECT_LT(worst, 0.001);
  }
}

TEST_F(TrackerTest, SaysLostOnBlankFramesAndComesBack) {
  for (const bool use_markers : {true, false}) {
    Tracker tracker(sweep().info, {.use_markers = use_markers});
    for (std::size_t i = 0; i < sweep().frames.size(); ++i) {
      const bool blank = i >= 8 && i < 12;
      const Frame frame = blank ? Blank(sweep().frames[i]) : sweep().frames[i];
      const TrackedFrame result = tracker.Track(frame);
      EXPECT_EQ(result.tracked, !blank)
          << "frame " << i << (use_markers ? ", markers" : ", features");
    }
    const double worst = WorstError(tracker);
    fmt::print("after the gap: worst {:.2e} m\n", worst);
    EXPECT_LT(worst, 0.0015);  // Measured: 0.43 mm.
  }
}

TEST_F(TrackerTest, BlankBeginningIsNoWorld) {
  Tracker tracker(sweep().info, {});
  for (std::size_t i = 0; i < 8; ++i) {
    const TrackedFrame result = tracker.Track(i < 3 ? Blank(sweep().frames[i]) : sweep().frames[i]);
    EXPECT_EQ(result.tracked, i >= 3) << i;
  }
  EXPECT_EQ(tracker.map().keyframes.front().data.frame_index, 3);
  EXPECT_LT(WorstError(tracker, 3), 0.001);
}

TEST_F(TrackerTest, SameBitsOnAnyNumberOfThreads) {
  std::vector<std::vector<Pose>> poses(2);
  for (std::size_t run = 0; run < 2; ++run) {
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, run + 1);
    Tracker tracker(sweep().info, {});
    for (std::size_t i = 0; i < 14; ++i)
      poses[run].push_back(tracker.T_world_color(tracker.Track(sweep().frames[i])));
  }
  for (std::size_t i = 0; i < poses[0].size(); ++i)
    EXPECT_EQ(poses[0][i].matrix(), poses[1][i].matrix()) << i;
}

TEST_F(TrackerTest, RefusesWhatItCannotUse) {
  Tracker tracker(sweep().info, {});
  Frame small = sweep().frames[0];
  small.color_rgb = small.color_rgb(cv::Rect(0, 0, 100, 100));
  EXPECT_THROW(tracker.Track(small), std::invalid_argument);
  StreamInfo unknown = sweep().info;
  unknown.room_markers.dictionary = "DICT_NO_SUCH";
  EXPECT_THROW(Tracker(unknown, {}), DataError);
}

TEST_F(TrackerTest, UsesTheDepthNoiseThatTheSensorStates) {
  const auto pose_of_last = [](const DepthNoise& noise, const TrackerOptions& options) {
    StreamInfo info = sweep().info;
    info.depth_noise = noise;
    Tracker tracker(info, options);
    for (std::size_t i = 0; i < 10; ++i) tracker.Track(sweep().frames[i]);
    EXPECT_TRUE(tracker.frames().back().tracked);
    return tracker.T_world_color(tracker.frames().back()).matrix();
  };
  // Without local bundle adjustment, which would hide them: depth against the keyframe, and that of
  // followed points.
  const TrackerOptions means[] = {{.use_keypoints = false, .local_keyframes = 0},
                                  {.use_markers = false, .use_dense = false, .local_keyframes = 0}};
  for (const TrackerOptions& options : means) {
    const auto usual = pose_of_last({}, options);
    EXPECT_EQ(usual, pose_of_last({}, options));
    EXPECT_NE(usual, pose_of_last({.constant_m = 0.02}, options)) << options.use_dense;
  }
}

TEST_F(TrackerTest, RefusesADepthNoiseThatIsImpossible) {
  StreamInfo info = sweep().info;
  info.depth_noise.quadratic_m_per_m2 = -1;
  try {
    Tracker tracker(info, {});
    FAIL() << "it was accepted";
  } catch (const DataError& error) {
    EXPECT_NE(std::string(error.what()).find("quadratic_m_per_m2 is -1"), std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace plumb
