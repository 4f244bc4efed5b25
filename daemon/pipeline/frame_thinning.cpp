// SPDX-License-Identifier: Apache-2.0
#include "daemon/pipeline/frame_thinning.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "algo/reconstruction/scene_assembly.hpp"
#include "words/progress.hpp"
#include "words/reconstruction.hpp"

namespace plumb {

bool NextFewerKeypoints(bool fewer, int stride, const TrackingLoad& load,
                        const KeypointBudgetOptions& options) {
  if (!(load.frame_period_s > 0) || !(load.tracking_s > 0)) return fewer;
  const double load_of_all = load.tracking_s / load.frame_period_s;
  if (!fewer)
    return load.late_s >= options.reduce_late_s && load_of_all > options.reduce_load * stride;
  return stride > 1 || load.late_s > options.restore_late_s ||
         load.since_change_s < options.restore_hold_s || load_of_all > options.restore_load;
}

namespace {

// Weights of the newest value. A keyframe takes several times as long as other frames, so tracking
// time is averaged over about a second.
constexpr double kPeriodWeight = 0.2;
constexpr double kTrackingWeight = 0.05;

// The first frames are all keyframes and not representative of the load; the queue can hold them.
constexpr int kFewFrames = 15;

double Smoothed(double before, double value, double weight) {
  return before > 0 ? before + weight * (value - before) : value;
}

}  // namespace

int NextStride(int stride, const TrackingLoad& load, const ThinningOptions& options) {
  if (!(load.frame_period_s > 0) || !(load.tracking_s > 0)) return stride;
  const double load_of_all = load.tracking_s / load.frame_period_s;
  if (load.late_s >= options.raise_late_s) {
    if (load.since_change_s < options.raise_hold_s || load_of_all <= options.aimed_load * stride)
      return stride;
    const double needed = std::ceil(load_of_all / options.aimed_load);
    return static_cast<int>(
        std::min<double>(std::max<double>(stride + 1, needed), options.max_stride));
  }
  const bool is_idle =
      load.late_s <= options.low_late_s && load.since_change_s >= options.lower_hold_s;
  if (stride > 1 && is_idle && load_of_all <= options.low_load * (stride - 1)) return stride - 1;
  return stride;
}

ThinnedFeed::ThinnedFeed(FrameFeed& feed, std::function<double()> now_s,
                         const ThinningOptions& options, const KeypointBudgetOptions& keypoints)
    : feed_(feed), now_s_(std::move(now_s)), options_(options), keypoint_options_(keypoints) {}

std::optional<Frame> ThinnedFeed::Next(const std::stop_token& stop) {
  if (handed_out_s_) {
    // Initially the mean of all, because the first frame is a keyframe and takes longest.
    const double weight = std::max(kTrackingWeight, 1.0 / num_taken_);
    tracking_s_ = Smoothed(tracking_s_, now_s_() - *handed_out_s_, weight);
  }
  handed_out_s_.reset();
  while (std::optional<Frame> frame = feed_.Next(stop)) {
    const double now_s = now_s_();
    if (Takes(frame->depth_time_s, feed_.taken_arrived_s().value_or(now_s), now_s)) {
      ++num_taken_;
      handed_out_s_ = now_s;
      frame->fewer_keypoints = fewer_keypoints_;
      return frame;
    }
    ++num_left_out_;
    ++num_unreported_;
  }
  return std::nullopt;
}

bool ThinnedFeed::Takes(double stamp_s, double arrived_s, double now_s) {
  if (!last_stamp_s_) changed_s_ = arrived_s;
  // Neither a gap in the frames nor a clock that is set means a slower sensor.
  if (const double elapsed_s = stamp_s - last_stamp_s_.value_or(stamp_s);
      elapsed_s > 0 && (frame_period_s_ == 0 || elapsed_s < 3 * frame_period_s_)) {
    frame_period_s_ = Smoothed(frame_period_s_, elapsed_s, kPeriodWeight);
    by_stamps_s_ += elapsed_s;
    by_arrivals_s_ += arrived_s - last_arrived_s_;
  }
  last_stamp_s_ = stamp_s;
  last_arrived_s_ = arrived_s;
  // Stamps are even where arrivals come in bursts, but their clock may have another rate.
  const double rate = by_stamps_s_ > 0 ? by_arrivals_s_ / by_stamps_s_ : 1.0;
  TrackingLoad load{.frame_period_s = rate * frame_period_s_,
                    .tracking_s = num_taken_ < kFewFrames ? 0.0 : tracking_s_,
                    .late_s = now_s - arrived_s,
                    .since_change_s = arrived_s - changed_s_};
  const bool fewer = NextFewerKeypoints(fewer_keypoints_, stride_, load, keypoint_options_);
  if (fewer != fewer_keypoints_) {
    fewer_keypoints_ = fewer;
    // This alone may clear the queue, so frames are not skipped yet.
    changed_s_ = arrived_s;
    load.since_change_s = 0.0;
  }
  const int next = NextStride(stride_, load, options_);
  if (next != stride_) {
    stride_ = next;
    changed_s_ = arrived_s;
    left_to_skip_ = std::min(left_to_skip_, stride_ - 1);
  }
  if (left_to_skip_ > 0) {
    --left_to_skip_;
    return false;
  }
  left_to_skip_ = stride_ - 1;
  return true;
}

int ThinnedFeed::TakeDropped() { return feed_.TakeDropped() + std::exchange(num_unreported_, 0); }

void ThinnedFeed::WarnIn(Scene& scene) const {
  if (num_left_out_ == 0) return;
  const std::int64_t lost = scene.frames_dropped - num_left_out_;
  const auto told = std::ranges::find_if(scene.warnings, [](const Message& said) {
    return said.Is(say::reconstruction::kFramesDropped);
  });
  if (told != scene.warnings.end() &&
      static_cast<double>(lost) > kDroppedToReport * static_cast<double>(scene.frames_total))
    *told = say::reconstruction::FramesDropped(lost, scene.frames_total);
  else if (told != scene.warnings.end())
    scene.warnings.erase(told);
  scene.warnings.push_back(say::progress::FramesLeftOut(num_left_out_, scene.frames_total));
}

}  // namespace plumb
