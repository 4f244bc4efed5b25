// SPDX-License-Identifier: Apache-2.0
// Renders the images of the simulated colour camera.
#pragma once

#include <cstdint>

#include <opencv2/core/mat.hpp>

#include "drivers/simulator/sensor/ray_caster.hpp"
#include "drivers/simulator/sensor/sensor_unit.hpp"
#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {

/// Renders colour images: light is integrated linearly over each pixel's area, the lens's blur and
/// the exposure; then vignetting, noise and tone curve are applied. Pixels on an edge of a marker's
/// print take 36 samples, stratified so that the coverage of a straight edge is accurate to about 1
/// %; others take fewer. Immutable: may be used from any number of threads. Parallel inside; the
/// result does not depend on the number of threads.
class ColorCamera {
 public:
  explicit ColorCamera(const SensorUnit& unit);
  /// @param time_s  Mid-exposure of the middle row, trajectory time.
  /// @param noise_seed  Seed for this image.
  /// @param gain  Gain of the linear red, green and blue by automatic exposure and white balance.
  /// @return CV_8UC3, red, green, blue.
  [[nodiscard]] cv::Mat Render(const World& world, const Trajectory& trajectory, double time_s,
                               std::uint64_t noise_seed,
                               const Eigen::Vector3f& gain = Eigen::Vector3f::Ones()) const;
  /// The two parts of Render(): the light on each pixel, CV_32FC3, which can be exposed again and
  /// again, each time with its own noise.
  [[nodiscard]] cv::Mat Light(const World& world, const Trajectory& trajectory, double time_s,
                              const Eigen::Vector3f& gain = Eigen::Vector3f::Ones()) const;
  [[nodiscard]] cv::Mat Expose(const cv::Mat& light, std::uint64_t noise_seed) const;

 private:
  struct Samples {
    Float4 du, dv, dt;  ///< Four samples each: pixels from the centre; seconds from mid-exposure.
  };
  struct Shot;  ///< Working data of one image.
  void BuildSamples();
  void Cast(Shot& shot, int tile_row) const;
  [[nodiscard]] cv::Mat EdgeMask(const Shot& shot) const;
  void Gather(const Shot& shot, int tile_row, cv::Mat& light) const;
  static constexpr std::size_t kNumPatterns = 32;
  using Patterns = std::vector<std::vector<Samples>>;
  [[nodiscard]] static const std::vector<Samples>& PatternOf(const Patterns& patterns, int x,
                                                             int y) {
    return patterns[Hash(static_cast<std::uint64_t>(x), static_cast<std::uint64_t>(y)) %
                    kNumPatterns];
  }
  [[nodiscard]] Eigen::Vector3f PointAt(const Shot& shot, int x, int y) const;
  [[nodiscard]] float GlareAt(const Shot& shot, int x, int y) const;
  [[nodiscard]] Eigen::Vector3f GatherInk(const Shot& shot, int x, int y) const;
  [[nodiscard]] Eigen::Vector3f GatherOutline(const Shot& shot, int x, int y,
                                              const Candidates& candidates) const;
  [[nodiscard]] Eigen::Vector3f GatherSmooth(const Shot& shot, int x, int y) const;

  SensorUnit unit_;
  PixelRays rays_;
  Patterns ink_samples_;  ///< Several patterns of each kind, chosen by pixel.
  Patterns outline_samples_;
  Patterns smooth_samples_;
  std::vector<std::uint8_t> codes_;  ///< 8-bit code of a linear value in 1/4095.
};

}  // namespace plumb::simulated
