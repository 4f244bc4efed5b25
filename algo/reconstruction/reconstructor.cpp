// SPDX-License-Identifier: Apache-2.0
#include "algo/reconstruction/reconstructor.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include "algo/base/errors.hpp"
#include "algo/base/statistics.hpp"
#include "algo/diagnosis/sweep_watch.hpp"
#include "algo/reconstruction/scene_assembly.hpp"
#include "algo/reconstruction/scene_solver.hpp"
#include "algo/tracking/map_budget.hpp"
#include "algo/tracking/tracker.hpp"
#include "words/reconstruction.hpp"

namespace plumb {
namespace {

// Keyframes of an answer that forms: those of a sweep of 100 frames at 15 Hz. It bounds the time
// and the memory that it takes from a long sweep.
constexpr std::size_t kMostUpToNow = 48;

TrackerOptions TrackingOptions(const ReconstructorOptions& options) {
  TrackerOptions tracking;
  tracking.use_markers = options.use_markers;
  tracking.use_keypoints = options.use_keypoints;
  tracking.keep_color = options.keep_color;
  tracking.keep_working_images = options.preset == Preset::kBest;
  tracking.keyframe_distance *= options.keyframe_spacing;
  tracking.keyframe_angle_rad *= options.keyframe_spacing;
  tracking.max_images = options.max_images;
  tracking.min_tracked_fraction =
      1.0 - options.keyframe_spacing * (1.0 - tracking.min_tracked_fraction);
  return tracking;
}

}  // namespace

struct Reconstructor::Impl {
  StreamInfo info;
  ReconstructorOptions options;
  Tracker tracker;
  std::int64_t dropped = 0;
  std::vector<double> median_depths_m;  // One per frame that has valid depth.
  std::vector<double> tracking_times_s;
  SweepWatch watch;
  TrackingReport last_report;

  Impl(const StreamInfo& stream, const ReconstructorOptions& reconstructor_options)
      : info(stream),
        options(reconstructor_options),
        tracker(stream, TrackingOptions(reconstructor_options)),
        watch(stream.usable_depth) {}

  [[nodiscard]] double Now() const { return options.now_s ? options.now_s() : 0.0; }

  TrackingReport AddFrame(const Frame& frame) {
    if (frame.color_rgb.cols != info.intrinsics.width ||
        frame.color_rgb.rows != info.intrinsics.height ||
        frame.depth_m.size() != frame.color_rgb.size())
      throw DataError(say::reconstruction::ImageSize(
          frame.index, frame.color_rgb.cols, frame.color_rgb.rows, frame.depth_m.cols,
          frame.depth_m.rows, info.intrinsics.width, info.intrinsics.height));
    if (watch.IsRepetition(frame)) {  // What is shown is what was shown.
      last_report.is_keyframe = false;
      return last_report;
    }
    TrackingReport report;
    DepthStatistics(frame.depth_m, report);
    const double start = Now();
    const TrackedFrame tracked = tracker.Track(frame);
    tracking_times_s.push_back(Now() - start);
    watch.Add(frame, tracked.num_markers > 0);
    report.tracked = tracked.tracked;
    report.is_keyframe = tracked.keyframe.has_value();
    report.num_keypoints = tracked.num_keypoints;
    report.num_markers = tracked.num_markers;
    if (tracked.tracked) {
      const double dt = tracked.depth_time_s - tracked.color_time_s;
      report.T_world_camera = PoseAfter(tracker.T_world_color(tracked), tracked.velocity_per_s, dt);
    }
    if (HasReferenceMarker(info, tracker.map()))
      report.T_scene_world = SceneFromWorld(info, tracker.map());
    last_report = report;
    return report;
  }

  // Every eighth pixel in each direction is enough for guidance.
  void DepthStatistics(const cv::Mat& depth_m, TrackingReport& report) {
    std::vector<float> z;
    int total = 0;
    for (int r = 4; r < depth_m.rows; r += 8) {
      for (int c = 4; c < depth_m.cols; c += 8) {
        ++total;
        if (const float value = depth_m.at<float>(r, c); value > 0) z.push_back(value);
      }
    }
    report.valid_depth = total > 0 ? static_cast<double>(z.size()) / total : 0.0;
    if (z.empty()) return;
    report.median_depth_m = TakeMedian(z);
    median_depths_m.push_back(report.median_depth_m);
  }

  [[nodiscard]] TrackedSweep Sweep(TrackingMap map) const {
    return {.info = info,
            .options = options,
            .frames = tracker.frames(),
            .map = std::move(map),
            .watch = watch,
            .num_dropped = dropped,
            .median_depths_m = median_depths_m,
            .tracking_times_s = tracking_times_s};
  }
};

Reconstructor::Reconstructor(const StreamInfo& info, const ReconstructorOptions& options)
    : impl_(std::make_unique<Impl>(info, options)) {}
Reconstructor::~Reconstructor() = default;
TrackingReport Reconstructor::AddFrame(const Frame& frame) { return impl_->AddFrame(frame); }
void Reconstructor::CountDropped(int num_frames) { impl_->dropped += num_frames; }

Scene Reconstructor::Finish(const std::stop_token& stop,
                            const std::function<void(double, const Message&)>& progress) {
  return SolveScene(impl_->Sweep(impl_->tracker.TakeMap()), stop, progress);
}

std::function<Scene(const std::stop_token&)> Reconstructor::SceneUpToNow() const {
  auto sweep = std::make_shared<TrackedSweep>(impl_->Sweep(impl_->tracker.map()));
  sweep->options.on_learned = {};
  sweep->options.max_keyframes = std::min(sweep->options.max_keyframes, kMostUpToNow);
  return [sweep](const std::stop_token& stop) {
    BoundImages(kMostUpToNow, sweep->map);
    return SolveScene(std::move(*sweep), stop, {});
  };
}

}  // namespace plumb
