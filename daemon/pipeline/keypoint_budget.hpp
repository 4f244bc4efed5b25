// Whether live frames are tracked with fewer keypoints while the computer is too slow.
#pragma once

#include "daemon/pipeline/tracking_load.hpp"

namespace plumb {

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

}  // namespace plumb
