// SPDX-License-Identifier: Apache-2.0
#include "daemon/monitoring/outline_watch.hpp"

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "algo/base/errors.hpp"
#include "daemon/loop/give_way.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/scanning/scan_session.hpp"
#include "drivers/files/image_file.hpp"

namespace plumb {
namespace {

constexpr int kPreviewColumns = 320;
constexpr int kPreviewQuality = 70;
constexpr std::chrono::milliseconds kOutlineEvery{500};
// An older picture is not shown as a current one; a page that shows it asks more often than this.
constexpr double kOutlineHolds_s = 1.5;
// After a failure: a disk may have been away for a moment.
constexpr std::chrono::seconds kTryAgain{10};

bool AreSame(const MarkerMap& a, const MarkerMap& b) {
  return std::ranges::equal(a, b, [](const auto& one, const auto& other) {
    return one.first == other.first && one.second.corners == other.second.corners;
  });
}

}  // namespace

std::string PreviewJpeg(const cv::Mat& color_rgb) {
  cv::Mat small;
  const int width = std::min(kPreviewColumns, color_rgb.cols);
  cv::resize(color_rgb, small, {width, color_rgb.rows * width / color_rgb.cols}, 0, 0,
             cv::INTER_AREA);
  const std::vector<std::uint8_t> jpeg = EncodeJpeg(small, kPreviewQuality);
  return {jpeg.begin(), jpeg.end()};
}

OutlineWatch::OutlineWatch(const SensorThread& sensors)
    : sensors_(sensors), thread_([this](const std::stop_token& stop) { Run(stop); }) {}

OutlineWatch::~OutlineWatch() {
  thread_.request_stop();
  thread_.join();
}

void OutlineWatch::Follow(OutlineJob job) {
  {
    const std::lock_guard lock(mutex_);
    if (job.scene == wanted_.scene && job.reference == wanted_.reference &&
        AreSame(job.markers_iec, wanted_.markers_iec))
      return;
    wanted_ = std::move(job);
    newest_.reset();
    ++turn_;
  }
  wake_.notify_all();
}

std::shared_ptr<const OutlinedPicture> OutlineWatch::Newest() {
  const double now_s = SteadySeconds();
  std::shared_ptr<const OutlinedPicture> newest;
  {
    const std::lock_guard lock(mutex_);
    if (wanted_.scene.empty()) return nullptr;
    asked_s_ = now_s;
    newest = newest_;
  }
  wake_.notify_all();
  return newest && now_s - newest->at_s < kOutlineHolds_s ? newest : nullptr;
}

void OutlineWatch::Run(const std::stop_token& stop) {
  GiveWayToScans();
  bool has_failed = false;
  for (std::uint64_t turn = 0; !stop.stop_requested();) {
    OutlineJob job;
    {
      std::unique_lock lock(mutex_);
      const auto is_another = [&] { return turn_ != turn; };
      if (has_failed)
        wake_.wait_for(lock, stop, kTryAgain, is_another);
      else
        wake_.wait(lock, stop, is_another);
      if (stop.stop_requested()) return;
      has_failed = has_failed && !is_another();
      turn = turn_;
      job = wanted_;
    }
    if (job.scene.empty()) continue;
    try {
      Look(job, turn, stop);
      has_failed = false;
    } catch (const Interrupted&) {
    } catch (const std::exception& error) {
      // The picture is shown without it; the comparison will say what is wrong with the reference.
      if (!has_failed) Log(LogLevel::kWarning, MessageOf(error).English());
      has_failed = true;
    }
  }
}

bool OutlineWatch::AwaitInterest(std::uint64_t turn, const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  return wake_.wait(
             lock, stop,
             [&] { return turn_ != turn || SteadySeconds() - asked_s_ < kOutlineHolds_s; }) &&
         turn_ == turn && !stop.stop_requested();
}

void OutlineWatch::Look(const OutlineJob& job, std::uint64_t turn, const std::stop_token& stop) {
  if (!AwaitInterest(turn, stop)) return;
  if (job.is_of_other_room && job.is_of_other_room()) return;
  std::optional<BodyOutline> outline;
  {
    const Scene scene = ReadApprovedScene(job.scene, job.check_reference, stop);
    const MarkerMap& markers = scene.planning ? job.markers_iec : scene.markers;
    if (markers.empty()) return;  // the room of a planning CT is not calibrated
    outline.emplace(scene,
                    scene.planning ? sensors_.snapshot().info.room_markers.dictionary
                                   : scene.room_markers.dictionary,
                    markers);
  }
  std::optional<std::int64_t> last;
  while (AwaitInterest(turn, stop)) {
    const Intrinsics camera = sensors_.snapshot().info.intrinsics;
    const std::optional<Frame> frame = sensors_.latest();
    // Of one unit: another one may just have been plugged in.
    const bool fits = frame && frame->color_rgb.cols == camera.width;
    if (fits && frame->index != last) {
      last = frame->index;
      OutlinedPicture picture{.jpeg = PreviewJpeg(frame->color_rgb),
                              .reference = job.reference,
                              .lines = {},
                              .is_placed = false,
                              .at_s = SteadySeconds()};
      const auto lines = outline->In(frame->color_rgb, camera);
      picture.is_placed = lines.has_value();
      picture.lines = lines.value_or(OutlineLines());
      const std::lock_guard lock(mutex_);
      if (turn_ == turn) newest_ = std::make_shared<const OutlinedPicture>(std::move(picture));
    }
    std::unique_lock lock(mutex_);
    if (wake_.wait_for(lock, stop, kOutlineEvery, [&] { return turn_ != turn; })) return;
  }
}

}  // namespace plumb
