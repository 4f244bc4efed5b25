// SPDX-License-Identifier: Apache-2.0
// Selects live frames to skip, or to track with fewer keypoints, while the computer is too slow.
#pragma once

#include <functional>
#include <optional>
#include <stop_token>

#include "algo/types/scene.hpp"
#include "daemon/pipeline/frame_feed.hpp"

namespace plumb {

/// State when a frame arrives at tracking.
struct TrackingLoad {
  double frame_period_s = 0.0;  ///< Time between the sensor's frames; 0 if unknown.
  double tracking_s = 0.0;      ///< Recent time to track one frame; 0 if unknown.
  double late_s = 0.0;          ///< Lateness of tracking behind the sensor.
  /// Since the last change of the stride or of the keypoints, or the start of the sweep.
  double since_change_s = 0.0;
};

/// Times in seconds.
struct KeypointBudgetOptions {
  /// Lateness at which keypoints are reduced: more than a keyframe or two cause, and less than the
  /// one at which frames are skipped, which costs more.
  double reduce_late_s = 0.1;
  double reduce_load = 0.85;     ///< Below it tracking catches up by itself, as in ThinningOptions.
  double restore_late_s = 0.07;  ///< Up to here tracking is in time: a few keyframes cause that.
  /// A frame takes 1.3 times as long with all keypoints (measured), so the load then stays below
  /// 0.7.
  double restore_load = 0.5;
  double restore_hold_s = 2.0;  ///< Delay after a change before all keypoints are used again.
};

/// Whether frames are tracked with fewer keypoints from now on: this starts when tracking is late
/// and cannot catch up, and ends when every frame is tracked in time and the load is low. Pure.
/// @param fewer   Whether they are now.
/// @param stride  One in this many frames is tracked.
[[nodiscard]] bool NextFewerKeypoints(bool fewer, int stride, const TrackingLoad& load,
                                      const KeypointBudgetOptions& options = {});

/// Starting values; times in seconds.
struct ThinningOptions {
  int max_stride = 4;  ///< Leaves 7.5 of 30 frames per second; fewer cannot follow a hand's motion.
  double raise_late_s = 0.15;  ///< Lateness at which tracking falls behind. Half a second may wait.
  /// Fraction of the time that tracking may use; the rest lets it catch up.
  double aimed_load = 0.85;
  /// More frames are taken again only if they would use less than this fraction.
  double low_load = 0.7;
  double low_late_s = 0.07;  ///< Counts as in time; the lateness of a few keyframes.
  /// Delay after a change before more frames are skipped, so that the queue can be worked off
  /// first.
  double raise_hold_s = 0.25;
  double lower_hold_s = 2.0;  ///< Delay after a change before more frames are taken again.
};

/// The stride from now on, 1 to `max_stride`: one in this many frames is tracked. Frames are
/// skipped evenly, so that the sweep has no gap, and before the queue overflows, which would lose
/// consecutive frames.
///
/// More frames are skipped once tracking falls behind and cannot catch up, enough that the rest can
/// be tracked in time; fewer only when it is in time and the load has been low for a while. Pure.
[[nodiscard]] int NextStride(int stride, const TrackingLoad& load,
                             const ThinningOptions& options = {});

/// A live feed without the skipped frames. Before any is skipped, frames are marked to be tracked
/// with fewer keypoints. Not thread-safe.
class ThinnedFeed : public FrameFeed {
 public:
  /// @param feed   Borrowed.
  /// @param now_s  The clock of FrameFeed::taken_arrived_s(). The rate of the frames' stamps does
  /// not matter: a program that sends a recording at half its speed leaves twice the time.
  explicit ThinnedFeed(FrameFeed& feed, std::function<double()> now_s = SteadySeconds,
                       const ThinningOptions& options = {},
                       const KeypointBudgetOptions& keypoints = {});

  std::optional<Frame> Next(const std::stop_token& stop) override;
  /// Includes skipped frames.
  int TakeDropped() override;
  void Finish() override { feed_.Finish(); }
  [[nodiscard]] std::optional<double> last_frame_s() const override { return feed_.last_frame_s(); }
  [[nodiscard]] std::optional<double> taken_arrived_s() const override {
    return feed_.taken_arrived_s();
  }

  [[nodiscard]] int stride() const { return stride_; }
  /// Adds to the scene's warnings that frames were left out, and takes them out of the number of
  /// the warning of dropped ones, which goes if the rest is below its limit.
  void WarnIn(Scene& scene) const;

 private:
  [[nodiscard]] bool Takes(double stamp_s, double arrived_s, double now_s);

  FrameFeed& feed_;
  const std::function<double()> now_s_;
  const ThinningOptions options_;
  const KeypointBudgetOptions keypoint_options_;
  bool fewer_keypoints_ = false;
  int stride_ = 1, left_to_skip_ = 0;
  int num_taken_ = 0, num_left_out_ = 0, num_unreported_ = 0;
  std::optional<double> last_stamp_s_, handed_out_s_;
  double last_arrived_s_ = 0.0, changed_s_ = 0.0;
  double by_stamps_s_ = 0.0, by_arrivals_s_ = 0.0;  // The same intervals, by either clock.
  double frame_period_s_ = 0.0, tracking_s_ = 0.0;
};

}  // namespace plumb
