// One scan from its first frame to its scene: a source, a decoding thread, a bounded queue, a
// reconstructor.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <string_view>

#include "algo/reconstruction/reconstructor.hpp"
#include "algo/types/frame.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// How far a scan is; for a bar, a light or a page.
struct ScanProgress {
  std::string_view step;  ///< "tracking", then what the reconstructor names.
  double fraction =
      0.0;  ///< Of this step, 0..1; of tracking 0 where the number of frames is unknown.
  std::int64_t frames = 0;
  std::int64_t frames_tracked = 0;
  std::int64_t frames_dropped = 0;
  const TrackingReport* tracking =
      nullptr;                   ///< Of the newest frame while tracking; valid during the call.
  const Frame* frame = nullptr;  ///< The newest frame while tracking; valid during the call.
};

/// Frames that somebody else reads, as the tracking thread takes them.
class FrameFeed {
 public:
  virtual ~FrameFeed() = default;
  /// Waits for the next frame; nothing at the end or on a stop request.
  virtual std::optional<Frame> Next(const std::stop_token& stop) = 0;
  /// Frames that were dropped since the last call, because tracking was late.
  virtual int TakeDropped() = 0;
  /// Called once, after Next() returned nothing without a stop: throws what ended the reading, if
  /// an error did.
  virtual void Finish() = 0;
  /// Steady time at which the last frame arrived; none where time has no meaning.
  [[nodiscard]] virtual std::optional<double> last_frame_s() const = 0;
};

struct ScanRunnerOptions {
  ReconstructorOptions
      reconstructor;  ///< `now_s` is filled in with the steady clock where it is empty.
  /// Frames come at the pace of their stamps and the oldest waiting frame is dropped when tracking
  /// is late, as live. Otherwise every frame counts, and the scene is the same bit for bit each
  /// time.
  bool realtime = false;
  std::size_t queue_capacity = 4;  ///< Decoded frames that wait for tracking; >= 1.
};

/// Runs a scan to its end on the calling thread, with one more thread that reads the source.
///
/// @param progress  If set, called on the calling thread.
/// @throws DataError, DeviceError from the source or the reconstructor; Interrupted on a stop
/// request.
[[nodiscard]] Scene RunScan(FrameSource& source, const ScanRunnerOptions& options,
                            const std::stop_token& stop = {},
                            const std::function<void(const ScanProgress&)>& progress = {});

/// The same with frames that another thread reads. `options.realtime` and `queue_capacity` are the
/// feed's matter.
[[nodiscard]] Scene RunScan(FrameFeed& feed, const StreamInfo& info,
                            const ReconstructorOptions& options, const std::stop_token& stop = {},
                            const std::function<void(const ScanProgress&)>& progress = {});

/// Seconds of the steady clock.
[[nodiscard]] double SteadySeconds();

}  // namespace plumb
