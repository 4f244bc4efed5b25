// SPDX-License-Identifier: Apache-2.0
// The outline of the reference over the camera's picture, so that a person can be laid in the same
// posture.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include "algo/base/message.hpp"
#include "algo/monitoring/body_outline.hpp"
#include "daemon/sweep/sensor_thread.hpp"

namespace plumb {

/// Small enough for many viewers: a JPEG of at most 320 columns.
[[nodiscard]] std::string PreviewJpeg(const cv::Mat& color_rgb);

/// Whose outline is wanted.
struct OutlineJob {
  std::filesystem::path scene = {};  ///< Folder; empty: no outline is wanted.
  std::string reference = {};        ///< Whose scene it is.
  /// As ScanJob has it. On the watch's thread.
  std::function<Message(const std::stop_token&)> check_reference = {};
  /// Whether the reference was scanned in another room, whose markers say nothing here. On the
  /// watch's thread.
  std::function<bool()> is_of_other_room = {};
  /// Where the room's markers are for a planning CT, which has none of its own.
  MarkerMap markers_iec = {};
};

/// A picture and what belongs over it.
struct OutlinedPicture {
  std::string jpeg;
  std::string reference;   ///< OutlineJob::reference.
  OutlineLines lines;      ///< Empty also where the body is not in the picture.
  bool is_placed = false;  ///< Whether markers say where the camera is.
  double at_s = 0.0;       ///< Steady time.
};

/// Used on the loop's thread. Looks at two images a second on a thread of its own that gives way to
/// scans, and only while a page asks.
class OutlineWatch {
 public:
  /// @param sensors  Borrowed.
  explicit OutlineWatch(const SensorThread& sensors);
  ~OutlineWatch();
  OutlineWatch(const OutlineWatch&) = delete;
  OutlineWatch& operator=(const OutlineWatch&) = delete;

  /// From now on nothing of another scene is shown.
  void Follow(OutlineJob job);
  /// The newest, and asks for the next; null without a scene or a camera, and until there is one.
  [[nodiscard]] std::shared_ptr<const OutlinedPicture> Newest();

 private:
  void Run(const std::stop_token& stop);
  /// Until another scene is wanted.
  void Look(const OutlineJob& job, std::uint64_t turn, const std::stop_token& stop);
  /// False: another scene is wanted.
  [[nodiscard]] bool AwaitInterest(std::uint64_t turn, const std::stop_token& stop);

  const SensorThread& sensors_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  OutlineJob wanted_;                              ///< Guarded.
  std::uint64_t turn_ = 0;                         ///< Guarded: counts what was wanted.
  double asked_s_ = -1e9;                          ///< Guarded: steady time.
  std::shared_ptr<const OutlinedPicture> newest_;  ///< Guarded.
  std::jthread thread_;  ///< Last: starts when the members above are initialised.
};

}  // namespace plumb
