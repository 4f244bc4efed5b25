// SPDX-License-Identifier: Apache-2.0
// One side of a marker's square in an image: its geometry, the pixels around it and the blurred
// pattern beside it. Used by the corner refinement.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/markers/marker_pattern.hpp"
#include "algo/types/marker.hpp"

namespace plumb::marker_side {

/// A pixel's own area has a sigma of 0.29 px.
inline constexpr double kMinBlur_px = 0.35;

/// The normal distribution function and density from a table: error below 1e-5, exactly zero or one
/// outside +-4.
class NormalTable {
 public:
  NormalTable() {
    for (int i = 0; i <= kSize; ++i) {
      const double z = -kLimit + i / kScale;
      cdf_[static_cast<std::size_t>(i)] =
          static_cast<float>(0.5 * std::erfc(-z / std::numbers::sqrt2));
      pdf_[static_cast<std::size_t>(i)] =
          static_cast<float>(std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi));
    }
  }
  /// {distribution, density} at z.
  [[nodiscard]] std::pair<float, float> At(float z) const {
    if (!(z > -kLimit)) return {0.0F, 0.0F};
    if (z >= kLimit) return {1.0F, 0.0F};
    const float position = (z + kLimit) * kScale;
    const int index = static_cast<int>(position);
    const float part = position - static_cast<float>(index);
    const auto i = static_cast<std::size_t>(index);
    return {cdf_[i] + part * (cdf_[i + 1] - cdf_[i]), pdf_[i] + part * (pdf_[i + 1] - pdf_[i])};
  }

 private:
  static constexpr float kLimit = 4.0F;
  static constexpr float kScale = 64.0F;
  static constexpr int kSize = 512;
  std::array<float, kSize + 2> cdf_{};
  std::array<float, kSize + 2> pdf_{};
};

inline const NormalTable& Normal() {
  static const NormalTable table;
  return table;
}

/// A tone curve and its inverse's slope.
struct Tone {
  explicit Tone(const ToneTable& table) : light(table) {
    constexpr float kLeastLight = 1e-4F;  // Per level; some curves are flat at black.
    for (std::size_t i = 0; i < 256; ++i) {
      const std::size_t below = i > 0 ? i - 1 : i;
      const std::size_t above = i < 255 ? i + 1 : i;
      const float light_per_level =
          (table[above] - table[below]) / static_cast<float>(above - below);
      levels_per_light[i] = 1.0F / std::max(light_per_level, kLeastLight);
    }
  }
  const ToneTable& light;
  std::array<float, 256> levels_per_light{};
};

/// A side of the square in its own coordinates: `along` from its first corner, `depth` towards the
/// inside of the marker, pixels.
struct Side {
  Eigen::Vector2d origin, direction, normal;
  double length_px = 0;
  Eigen::Matrix3d
      pixel_to_cells;  ///< (column, row) with this side on top: 0..N along, 0..N in depth.
  std::array<double, 2> depth_one{},
      depth_two{};     ///< Depth of the lines one and two cells inside, at both ends.
  double cell_px = 0;  ///< Mean depth of one cell.
  double outside_px = 0, inside_px = 0;  ///< Extent of the band of pixels that is used.
  double bow_px = 0;                     ///< Depth of the curved side at its middle.
  /// Darkness (0 paper, 1 ink) of the border and the first two code rows along the side, blurred
  /// along it.
  std::array<std::vector<float>, 3> darkness;
};

/// A pixel near the side.
struct Sample {
  float depth, along, value;      ///< along: 0..1
  float levels_per_light;         ///< Of the tone curve at this value.
  std::array<float, 3> darkness;  ///< Of border, first and second code row at this place.
};

/// Nothing for a side that is too short or a degenerate square.
/// @param index  Of the side, clockwise from the top of the print.
[[nodiscard]] std::optional<Side> MakeSide(const ImageCorners& corners, int index,
                                           const MarkerPattern& pattern, double blur_along_px,
                                           double edge_shift_px,
                                           const std::optional<Intrinsics>& intrinsics);

/// The image pixels in a band along the side, as many as are useful. Without interpolation, because
/// each pixel is itself a measurement.
void CollectSamples(const cv::Mat& gray, const Tone& tone, const Side& side, int wanted,
                    std::vector<Sample>& samples);

}  // namespace plumb::marker_side
