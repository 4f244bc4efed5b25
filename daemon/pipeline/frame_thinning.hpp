// Which live frames are left out on purpose while the computer is too slow to track all of them.
#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>

#include "daemon/pipeline/scan_runner.hpp"

namespace plumb {

/// Starting values; times in seconds.
struct ThinningOptions {
  int max_stride = 4;          ///< Of 30 frames a second 7.5 are left; fewer lose a hand's motion.
  double raise_late_s = 0.15;  ///< So late, tracking falls behind. Half a second may wait.
  double aimed_load = 0.85;    ///< Share of the time that tracking may need: with less it catches
                               ///< up by itself.
  double low_load = 0.7;       ///< More are taken again only if they would need no more than this.
  double low_late_s = 0.07;    ///< In time: the lateness of a few keyframes.
  double raise_hold_s = 0.25;  ///< After a change, before more are left out: what waits already has
                               ///< to be worked off first.
  double lower_hold_s = 2.0;   ///< After a change, before more are taken again.
};

/// What is known when a frame comes to tracking.
struct TrackingLoad {
  double frame_period_s = 0.0;  ///< Between the sensor's frames; 0: not known yet.
  double tracking_s = 0.0;      ///< That one frame takes, lately; 0: not known yet.
  double late_s = 0.0;          ///< By which tracking is behind the sensor.
  double since_change_s = 0.0;  ///< Since the stride last changed, or the sweep began.
};

/// The stride from now on, 1 to `max_stride`: one frame in so many is tracked. Frames are left out
/// evenly, so that the sweep has no gap, and before the queue overflows, which loses frames in a
/// row.
///
/// More are left out once tracking falls behind and has no time to catch up, so many that the rest
/// can be tracked in time; fewer only when it is in time and the load has been low for a while.
/// Pure.
[[nodiscard]] int NextStride(int stride, const TrackingLoad& load,
                             const ThinningOptions& options = {});

/// A live feed without the frames that are left out. One thread calls.
class ThinnedFeed : public FrameFeed {
 public:
  /// @param feed   Borrowed.
  /// @param now_s  A clock that runs as the frames' stamps do.
  explicit ThinnedFeed(FrameFeed& feed, std::function<double()> now_s = SteadySeconds,
                       const ThinningOptions& options = {});

  std::optional<Frame> Next(const std::stop_token& stop) override;
  /// Those that were left out, too.
  int TakeDropped() override;
  void Finish() override { feed_.Finish(); }
  [[nodiscard]] std::optional<double> last_frame_s() const override { return feed_.last_frame_s(); }

  [[nodiscard]] int stride() const { return stride_; }
  [[nodiscard]] int num_left_out() const { return num_left_out_; }
  /// A sentence for the scene's warnings; empty if no frame was left out.
  [[nodiscard]] std::string Warning() const;

 private:
  [[nodiscard]] bool Takes(double stamp_s, double arrived_s);

  FrameFeed& feed_;
  const std::function<double()> now_s_;
  const ThinningOptions options_;
  int stride_ = 1, left_to_skip_ = 0;
  int num_taken_ = 0, num_left_out_ = 0, num_unreported_ = 0;
  std::optional<double> last_stamp_s_, handed_out_s_, least_lag_s_;
  double changed_s_ = 0.0;
  double frame_period_s_ = 0.0, tracking_s_ = 0.0;
};

}  // namespace plumb
