// SPDX-License-Identifier: Apache-2.0
// Collects, frame by frame, what the diagnosis of a sweep needs and the map does not keep.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "algo/diagnosis/diagnosis.hpp"
#include "algo/types/frame.hpp"

namespace plumb {

/// Not thread-safe: call from one thread.
class SweepWatch {
 public:
  explicit SweepWatch(const UsableDepth& range) : range_(range) {}

  /// Whether the frame has an image of the frame before with a new stamp, so that it shows nothing
  /// of its moment. Both images again and again are a player that waits, or a sensor at rest.
  /// Call for each frame, before Add().
  [[nodiscard]] bool IsRepetition(const Frame& frame);

  /// A frame that is no repetition.
  /// @param shows_marker  Whether a marker of the room was found in it.
  void Add(const Frame& frame, bool shows_marker);

  /// All symptoms that do not need the map. Looks for foreign markers if no frame showed one of the
  /// room's, which takes some seconds.
  /// @param any_decoded  Whether a keyframe decoded a marker, even one that its pose contradicts.
  [[nodiscard]] Symptoms Finish(const StreamInfo& info, bool any_decoded) const;

 private:
  void CountRange(const cv::Mat& depth_m);
  void MeasureExposure(const cv::Mat& color_rgb);

  UsableDepth range_;
  ImageMotion color_motion_, depth_motion_;
  std::optional<std::uint64_t> color_digest_, depth_digest_;
  std::int64_t num_frames_ = 0, repeated_color_ = 0, repeated_depth_ = 0;
  std::int64_t depth_near_ = 0, depth_far_ = 0, depth_measured_ = 0;
  bool at_rest_ = false;  // The last frame repeated both images, or was the first.
  std::vector<double> grays_;
  std::int64_t color_white_ = 0, color_pixels_ = 0, flickers_ = 0;
  bool markers_seen_ = false;
  std::vector<cv::Mat> without_marker_;  // Some images, until a marker is seen.
  std::int64_t next_kept_ = 0, kept_step_ = 1;
};

}  // namespace plumb
