// SPDX-License-Identifier: Apache-2.0
// What depth cameras other than structured light make of a true depth image.
#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "drivers/simulator/sensor/sensor_unit.hpp"

namespace plumb::simulated {

/// One true depth image as the unit's class measures it.
class ClassDepth {
 public:
  /// @param true_m, skin  CV_32FC1 and CV_8UC1 (1 on skin) on the depth camera's grid; must outlive
  ///                      this.
  ClassDepth(const SensorUnit& unit, const cv::Mat& true_m, const cv::Mat& skin, double time_s,
             std::uint64_t noise_seed);
  /// Measured depth of a pixel before range and rounding, metres.
  [[nodiscard]] double At(int x, int y, float cosine) const;

 private:
  [[nodiscard]] double Stereo(int x, int y) const;
  [[nodiscard]] double TimeOfFlight(int x, int y, float cosine) const;
  [[nodiscard]] double Lidar(int x, int y) const;
  /// True depth beside a pixel; that of the pixel itself where there is none.
  [[nodiscard]] double Beside(int x, int y, int dx, int dy) const;

  const SensorUnit& unit_;
  const cv::Mat& true_m_;
  const cv::Mat& skin_;
  std::vector<float> noise_;
  double pixels_ = 1.0;  // of this image per pixel of one of 640 columns
  double offset_m_ = 0.0;
  double tilt_x_ = 0.0, tilt_y_ = 0.0;
};

}  // namespace plumb::simulated
