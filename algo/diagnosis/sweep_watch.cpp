// SPDX-License-Identifier: Apache-2.0
#include "algo/diagnosis/sweep_watch.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

#include <opencv2/core.hpp>

#include "algo/base/statistics.hpp"

namespace plumb {
namespace {

constexpr std::size_t kKeptImages = 8;

// FNV-1a over words of eight bytes: two images of a sensor never have all pixels in common.
std::uint64_t DigestOf(const cv::Mat& image) {
  std::uint64_t digest = 0xcbf29ce484222325U;
  const std::size_t bytes = static_cast<std::size_t>(image.cols) * image.elemSize();
  for (int r = 0; r < image.rows; ++r) {
    const std::uint8_t* row = image.ptr<std::uint8_t>(r);
    for (std::size_t i = 0; i + 8 <= bytes; i += 8) {
      std::uint64_t word = 0;
      std::memcpy(&word, row + i, 8);
      digest = (digest ^ word) * 0x100000001b3U;
    }
  }
  return digest;
}

bool IsRepeated(const cv::Mat& image, std::optional<std::uint64_t>& last) {
  const std::uint64_t digest = DigestOf(image);
  const bool repeated = last == digest;
  last = digest;
  return repeated;
}

}  // namespace

bool SweepWatch::IsRepetition(const Frame& frame) {
  const bool color_again = IsRepeated(frame.color_rgb, color_digest_);
  const bool depth_again = IsRepeated(frame.depth_m, depth_digest_);
  // Without depth nothing was measured that could be repeated: a covered sensor.
  if (cv::countNonZero(frame.depth_m) == 0) return false;
  // Where both stand still for longer, a player waits before its sweep begins or after it ended.
  const bool both_again = color_again && depth_again;
  const bool waits = both_again && at_rest_;
  at_rest_ = both_again || num_frames_ == 0;
  if (waits) return false;
  if (color_again) ++repeated_color_;
  if (depth_again) ++repeated_depth_;
  if (!color_again && !depth_again) return false;
  ++num_frames_;
  return true;
}

void SweepWatch::Add(const Frame& frame, bool shows_marker) {
  color_motion_.AddColor(frame.color_rgb, frame.color_time_s);
  depth_motion_.AddDepth(frame.depth_m, frame.depth_time_s);
  CountRange(frame.depth_m);
  MeasureExposure(frame.color_rgb);
  markers_seen_ = markers_seen_ || shows_marker;
  if (markers_seen_) {
    without_marker_.clear();
  } else if (num_frames_ == next_kept_) {
    without_marker_.push_back(frame.color_rgb);
    if (without_marker_.size() > kKeptImages) {  // Every second, so that they span the sweep.
      for (std::size_t i = 1; 2 * i < without_marker_.size(); ++i)
        without_marker_[i] = without_marker_[2 * i];
      without_marker_.resize((without_marker_.size() + 1) / 2);
      kept_step_ *= 2;
    }
    next_kept_ += kept_step_;
  }
  ++num_frames_;
}

// Every eighth pixel in each direction is enough.
void SweepWatch::CountRange(const cv::Mat& depth_m) {
  for (int r = 4; r < depth_m.rows; r += 8) {
    for (int c = 4; c < depth_m.cols; c += 8) {
      const float z = depth_m.at<float>(r, c);
      if (!(z > 0)) continue;
      ++depth_measured_;
      if (z < range_.nearest_m) ++depth_near_;
      if (z > range_.farthest_m) ++depth_far_;
    }
  }
}

// Likewise.
void SweepWatch::MeasureExposure(const cv::Mat& color_rgb) {
  constexpr int kWhiteFrom = 250;
  constexpr double kFlicker = 0.1;  // Sweeps over a room change by 0 to 2 % from image to image.
  std::int64_t sum = 0, count = 0;
  for (int r = 4; r < color_rgb.rows; r += 8) {
    for (int c = 4; c < color_rgb.cols; c += 8) {
      const auto& pixel = color_rgb.at<cv::Vec3b>(r, c);
      sum += pixel[0] + pixel[1] + pixel[2];
      ++count;
      if (std::min({pixel[0], pixel[1], pixel[2]}) >= kWhiteFrom) ++color_white_;
    }
  }
  if (count == 0) return;
  color_pixels_ += count;
  const double gray = static_cast<double>(sum) / (3.0 * static_cast<double>(count));
  if (!grays_.empty() && std::abs(gray - grays_.back()) > kFlicker * std::min(gray, grays_.back()))
    ++flickers_;
  grays_.push_back(gray);
}

Symptoms SweepWatch::Finish(const StreamInfo& info, bool any_decoded) const {
  Symptoms symptoms;
  symptoms.marker_length_m = info.room_markers.length_m;
  symptoms.depth_unit_assumed = info.depth_unit_assumed;
  symptoms.depth_units_per_metre = info.depth_units_per_metre;
  symptoms.cameras_assumed = info.intrinsics_assumed;
  symptoms.depth_camera_unknown = info.depth_camera_unknown;
  symptoms.focal_px = info.intrinsics.fx;
  symptoms.stream_offset = EstimateStreamOffset(color_motion_.rates(), depth_motion_.rates());
  symptoms.num_frames = num_frames_;
  symptoms.num_repeated_depth = repeated_depth_;
  symptoms.num_repeated_color = repeated_color_;
  symptoms.nearest_m = range_.nearest_m;
  symptoms.farthest_m = range_.farthest_m;
  if (!grays_.empty()) {
    std::vector<double> grays = grays_;
    symptoms.median_gray = TakeMedian(grays);
    symptoms.share_white = static_cast<double>(color_white_) / static_cast<double>(color_pixels_);
    symptoms.share_flickers = static_cast<double>(flickers_) / static_cast<double>(grays_.size());
  }
  symptoms.widths_per_s = color_motion_.MedianWidthsPerSecond();
  if (depth_measured_ > 0) {
    const auto measured = static_cast<double>(depth_measured_);
    symptoms.share_near = static_cast<double>(depth_near_) / measured;
    symptoms.share_far = static_cast<double>(depth_far_) / measured;
  }
  if (!any_decoded && !markers_seen_ && !without_marker_.empty())
    symptoms.foreign_markers =
        FindForeignMarkers(without_marker_, MarkerDictionary::ByName(info.room_markers.dictionary));
  return symptoms;
}

}  // namespace plumb
