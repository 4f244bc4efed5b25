// SPDX-License-Identifier: Apache-2.0
// The offset between the clocks of the colour and the depth stream, from the motion that both show.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace plumb {

struct StreamOffset {
  double offset_s = 0.0;  ///< Depth was taken so much earlier than it is stamped: > 0, its stamps
                          ///< are late.
  double sigma_s = 0.0;   ///< Standard deviation.
};

/// Motion of one stream's image from frame to frame. Add() takes about 0.3 ms for 640x480.
class ImageMotion {
 public:
  /// Rate at which the image moved between two frames, in pixels of the small image for a second.
  struct Rate {
    double time_s = 0.0;  ///< Middle between the two stamps.
    Eigen::Vector2d px_per_s = Eigen::Vector2d::Zero();
  };

  /// A colour image: CV_8UC3 or CV_8UC1.
  void AddColor(const cv::Mat& image, double time_s);
  /// A depth image: CV_32FC1, metres, 0 where nothing was measured.
  void AddDepth(const cv::Mat& depth_m, double time_s);

  [[nodiscard]] const std::vector<Rate>& rates() const { return rates_; }
  /// Median speed in widths of the image for a second; 0 for less than two images.
  [[nodiscard]] double MedianWidthsPerSecond() const;

 private:
  void Add(const cv::Mat& small, double time_s);

  cv::Mat previous_, window_;
  double previous_time_s_ = 0.0;
  std::vector<Rate> rates_;
};

/// The offset at which the rates of depth follow those of colour best, from -0.6 to 0.6 s.
/// @return nothing if the sweep is too short or too steady for an estimate.
[[nodiscard]] std::optional<StreamOffset> EstimateStreamOffset(
    const std::vector<ImageMotion::Rate>& color, const std::vector<ImageMotion::Rate>& depth);

}  // namespace plumb
