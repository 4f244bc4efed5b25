// SPDX-License-Identifier: Apache-2.0
#include "daemon/pipeline/scan_runner.hpp"

#include <atomic>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "words/progress.hpp"

namespace plumb {
namespace {

/// A still camera before a wall: frames without end, until `fail_at`.
class WallSource : public FrameSource {
 public:
  explicit WallSource(std::int64_t num_frames, std::int64_t fail_at = -1)
      : num_frames_(num_frames), fail_at_(fail_at) {
    info_.intrinsics = {.width = 160, .height = 120, .fx = 130, .fy = 130, .cx = 79.5, .cy = 59.5};
    info_.num_frames = num_frames;
    info_.warnings = {Message::Verbatim("the wall is only a wall")};
  }
  const StreamInfo& info() const override { return info_; }
  std::optional<Frame> Next() override {
    if (index_ == fail_at_) throw DataError("frame 3 is damaged");
    if (index_ == num_frames_) return std::nullopt;
    Frame frame;
    frame.index = index_;
    frame.color_time_s = frame.depth_time_s =
        0.01 * static_cast<double>(index_) + (index_ < gap_at ? 0.0 : 1e10);
    frame.color_rgb = cv::Mat(120, 160, CV_8UC3, cv::Scalar::all(128));
    frame.depth_m = cv::Mat(120, 160, CV_32FC1, cv::Scalar(1.0));
    ++index_;
    return frame;
  }
  [[nodiscard]] std::int64_t num_read() const { return index_; }

  std::int64_t gap_at = 1'000'000'000;  ///< From this frame on, stamps are some centuries later.

 private:
  StreamInfo info_;
  const std::int64_t num_frames_, fail_at_;
  std::atomic<std::int64_t> index_ = 0;
};

TEST(ScanRunnerTest, HandsEveryFrameOnAndKeepsTheSourcesWarnings) {
  WallSource source(12);
  std::int64_t last = 0;
  const Scene scene =
      RunScan(source, {}, {}, [&](const ScanProgress& progress) { last = progress.frames; });
  EXPECT_EQ(last, 12);
  EXPECT_EQ(scene.frames_total, 12);
  EXPECT_EQ(scene.frames_dropped, 0);
  EXPECT_THAT(EnglishTexts(scene.warnings), testing::Contains("the wall is only a wall"));
}

TEST(ScanRunnerTest, PassesOnWhatTheSourceThrows) {
  WallSource source(12, /*fail_at=*/3);
  EXPECT_THROW((void)RunScan(source, {}), DataError);
}

TEST(ScanRunnerTest, StopsOnRequestWithoutReadingToTheEnd) {
  WallSource source(1'000'000'000);
  std::stop_source stop;
  EXPECT_THROW((void)RunScan(source, {}, stop.get_token(),
                             [&](const ScanProgress& progress) {
                               if (progress.frames == 5) stop.request_stop();
                             }),
               Interrupted);
  EXPECT_LE(source.num_read(), 5 + 4 + 1);  // handed on, waiting in the queue, in the reader's hand
}

// 40 frames at 100 Hz while each takes longer than its 10 ms: live, some must go, and every one is
// accounted for.
TEST(ScanRunnerTest, LiveItDropsTheOldestAndCounts) {
  WallSource source(40);
  ScanRunnerOptions live;
  live.realtime = true;
  live.queue_capacity = 1;
  const Scene scene = RunScan(source, live, {}, [&](const ScanProgress& progress) {
    if (!progress.step.Is(say::progress::kTracking)) return;
    const double until_s = SteadySeconds() + 0.03;
    while (SteadySeconds() < until_s) {
    }
  });
  EXPECT_GT(scene.frames_dropped, 5);
  EXPECT_EQ(scene.frames_total, 40);
}

TEST(ScanRunnerTest, LiveItDoesNotWaitThroughAGapInTheStamps) {
  WallSource source(8);
  source.gap_at = 4;
  ScanRunnerOptions live;
  live.realtime = true;
  std::int64_t last = 0;
  const Scene scene =
      RunScan(source, live, {}, [&](const ScanProgress& progress) { last = progress.frames; });
  EXPECT_EQ(last, 8) << "the frames after the gap come after five seconds";
  EXPECT_EQ(scene.frames_total, 8);
}

}  // namespace
}  // namespace plumb
