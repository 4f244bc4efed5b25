// SPDX-License-Identifier: Apache-2.0
#include "daemon/pipeline/scan_runner.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "algo/base/errors.hpp"
#include "algo/diagnosis/diagnosis.hpp"
#include "daemon/loop/bounded_queue.hpp"
#include "daemon/pipeline/frame_thinning.hpp"
#include "words/progress.hpp"

namespace plumb {
namespace {

/// Reads the source on its own thread and passes its frames to the queue until the end, an error or
/// a stop request.
class FrameReader : public FrameFeed {
 public:
  FrameReader(FrameSource& source, bool realtime, std::size_t capacity)
      : source_(source),
        realtime_(realtime),
        queue_(capacity),
        thread_([this](const std::stop_token& stop) { Run(stop); }) {}

  std::optional<Frame> Next(const std::stop_token& stop) override {
    std::optional<Arrived> arrived = queue_.Pop(stop);
    if (!arrived) return std::nullopt;
    taken_arrived_s_ = arrived->time_s;
    return std::move(arrived->frame);
  }
  int TakeDropped() override { return dropped_.exchange(0); }

  /// Ends the thread.
  void Finish() override {
    thread_.request_stop();
    queue_.Close();
    thread_.join();
    if (error_) std::rethrow_exception(error_);
  }

  [[nodiscard]] std::optional<double> last_frame_s() const override {
    return realtime_ ? std::optional<double>(last_frame_s_) : std::nullopt;
  }
  [[nodiscard]] std::optional<double> taken_arrived_s() const override {
    return realtime_ ? std::optional<double>(taken_arrived_s_) : std::nullopt;
  }

 private:
  struct Arrived {
    Frame frame;
    double time_s = 0.0;
  };

  void Run(const std::stop_token& stop) {
    try {
      while (!stop.stop_requested()) {
        std::optional<Frame> frame = source_.Next();
        if (!frame) break;
        if (realtime_ && !WaitForItsTime(frame->depth_time_s, stop)) break;
        last_frame_s_ = SteadySeconds();
        if (realtime_) {
          dropped_ += queue_.PushDroppingOldest({std::move(*frame), last_frame_s_});
        } else if (!queue_.Push({std::move(*frame), last_frame_s_}, stop)) {
          break;
        }
      }
    } catch (...) {
      error_ = std::current_exception();
    }
    queue_.Close();
  }

  bool WaitForItsTime(double stamp_s, const std::stop_token& stop) {
    using Clock = std::chrono::steady_clock;
    // A recording may have been paused, or its clock changed: long gaps are cut short.
    constexpr double kLongestGap_s = 5.0;
    if (!last_stamp_s_ || stamp_s - *last_stamp_s_ > kLongestGap_s) {
      first_stamp_s_ = last_stamp_s_ ? stamp_s - kLongestGap_s : stamp_s;
      start_ = Clock::now();
    }
    last_stamp_s_ = stamp_s;
    const std::chrono::duration<double> after_start(stamp_s - first_stamp_s_);
    std::unique_lock lock(wait_mutex_);
    waiting_.wait_until(lock, stop,
                        start_ + std::chrono::duration_cast<Clock::duration>(after_start),
                        [] { return false; });
    return !stop.stop_requested();
  }

  FrameSource& source_;
  const bool realtime_;
  BoundedQueue<Arrived> queue_;
  std::atomic<int> dropped_ = 0;
  std::atomic<double> last_frame_s_ = 0.0;
  double taken_arrived_s_ = 0.0;  ///< Only for who calls Next().
  std::optional<double> last_stamp_s_;
  double first_stamp_s_ = 0.0;  ///< Of the frame that came, or would have come, at start_.
  std::chrono::steady_clock::time_point start_;
  std::mutex wait_mutex_;
  std::condition_variable_any waiting_;
  std::exception_ptr error_;
  std::jthread thread_;  // last: starts when the members above are initialised
};

/// For a recording, the cameras can still be stated. A live sweep keeps its scene, and the
/// comparison refuses it with the same words.
void RefuseUnfitCameras(const Scene& scene) {
  const auto unfit = std::ranges::find_if(scene.refusals, IsOfAssumedCameras);
  if (unfit != scene.refusals.end()) throw DataError(*unfit);
}

}  // namespace

Scene RunScan(FrameFeed& feed, const StreamInfo& info, const ReconstructorOptions& options,
              const std::stop_token& stop,
              const std::function<void(const ScanProgress&)>& progress) {
  ReconstructorOptions reconstructor_options = options;
  if (!reconstructor_options.now_s) reconstructor_options.now_s = SteadySeconds;
  Reconstructor reconstructor(info, reconstructor_options);

  ScanProgress state{.step = say::progress::Tracking()};
  const double expected_frames = static_cast<double>(info.num_frames.value_or(0));
  while (std::optional<Frame> frame = feed.Next(stop)) {
    if (const int dropped = feed.TakeDropped(); dropped > 0) {
      reconstructor.CountDropped(dropped);
      state.frames_dropped += dropped;
    }
    const TrackingReport report = reconstructor.AddFrame(*frame);
    ++state.frames;
    state.frames_tracked += report.tracked ? 1 : 0;
    const double seen = static_cast<double>(state.frames + state.frames_dropped);
    state.fraction = expected_frames > 0 ? std::min(1.0, seen / expected_frames) : 0.0;
    state.tracking = &report;
    state.frame = &*frame;
    state.sweep = &reconstructor;
    if (progress) progress(state);
    state.tracking = nullptr;
    state.frame = nullptr;
    state.sweep = nullptr;
  }
  const std::optional<double> last_frame_s = feed.last_frame_s();
  if (stop.stop_requested()) throw Interrupted(say::progress::Interrupted());
  feed.Finish();
  if (const int dropped = feed.TakeDropped(); dropped > 0) reconstructor.CountDropped(dropped);

  Scene scene = reconstructor.Finish(stop, [&](double fraction, const Message& step) {
    state.step = step;
    state.fraction = fraction;
    if (progress) progress(state);
  });
  // Live, frames may still have been waiting when the last one arrived; that wait belongs to the
  // time to the result.
  if (last_frame_s) scene.timings_s["after_last_frame"] = SteadySeconds() - *last_frame_s;
  std::vector<Message> warnings = info.warnings;
  for (const Message& warning : scene.warnings) {
    if (std::find(warnings.begin(), warnings.end(), warning) == warnings.end())
      warnings.push_back(warning);
  }
  scene.warnings = std::move(warnings);
  return scene;
}

Scene RunScan(FrameSource& source, const ScanRunnerOptions& options, const std::stop_token& stop,
              const std::function<void(const ScanProgress&)>& progress) {
  FrameReader reader(source, options.realtime, options.queue_capacity);
  if (!options.realtime) {
    Scene scene = RunScan(reader, source.info(), options.reconstructor, stop, progress);
    RefuseUnfitCameras(scene);
    return scene;
  }
  ThinnedFeed thinned(reader);
  Scene scene = RunScan(thinned, source.info(), options.reconstructor, stop, progress);
  RefuseUnfitCameras(scene);
  thinned.WarnIn(scene);
  return scene;
}

}  // namespace plumb
