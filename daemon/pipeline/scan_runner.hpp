// SPDX-License-Identifier: Apache-2.0
// One scan from its first frame to its scene: a source, a decoding thread, a bounded queue, a
// reconstructor.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>

#include "algo/base/message.hpp"
#include "algo/reconstruction/reconstructor.hpp"
#include "algo/types/frame.hpp"
#include "algo/types/scene.hpp"
#include "daemon/pipeline/frame_feed.hpp"

namespace plumb {

/// Progress of a scan for a bar, a light or a page.
struct ScanProgress {
  Message step;  ///< "tracking", then the steps of the reconstructor.
  /// Completed fraction of this step, 0..1; 0 for tracking if the number of frames is unknown.
  double fraction = 0.0;
  std::int64_t frames = 0;
  std::int64_t frames_tracked = 0;
  std::int64_t frames_dropped = 0;
  const TrackingReport* tracking =
      nullptr;                   ///< Of the newest frame while tracking; valid during the call.
  const Frame* frame = nullptr;  ///< The newest frame while tracking; valid during the call.
  const Reconstructor* sweep = nullptr;  ///< While tracking, with that frame; during the call.
};

struct ScanRunnerOptions {
  ReconstructorOptions reconstructor;  ///< `now_s` is set to the steady clock if it is empty.
  /// Frames arrive at the pace of their stamps, and the oldest waiting frame is dropped when
  /// tracking is late, as live. Otherwise every frame is used, and the scene is the same bit for
  /// bit each time.
  bool realtime = false;
  std::size_t queue_capacity = 4;  ///< Decoded frames that wait for tracking; >= 1.
};

/// Runs a scan to its end on the calling thread, with one more thread that reads the source.
///
/// @param progress  If set, called on the calling thread.
/// @throws DataError, DeviceError from the source or the reconstructor; Interrupted on a stop
///         request.
[[nodiscard]] Scene RunScan(FrameSource& source, const ScanRunnerOptions& options,
                            const std::stop_token& stop = {},
                            const std::function<void(const ScanProgress&)>& progress = {});

/// The same with frames that another thread reads. The feed replaces `options.realtime` and
/// `queue_capacity`.
[[nodiscard]] Scene RunScan(FrameFeed& feed, const StreamInfo& info,
                            const ReconstructorOptions& options, const std::stop_token& stop = {},
                            const std::function<void(const ScanProgress&)>& progress = {});

}  // namespace plumb
