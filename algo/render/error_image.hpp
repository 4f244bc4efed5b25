// SPDX-License-Identifier: Apache-2.0
// Draws the error map.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/base/units.hpp"
#include "algo/render/color_scale.hpp"
#include "algo/render/picture_words.hpp"
#include "algo/types/height_map.hpp"
#include "algo/verdict/default_tolerance.hpp"

namespace plumb {

struct ErrorImageOptions {
  double tolerance_m =
      kDefaultShiftTolerance_mm * kMillimetre;  ///< Tolerance of the signed scale; > 0.
  bool paper_colors = false;  ///< The paper's scale: |e|, blue at 0, red at 10 cm.
  std::string subtitle = {};
  const HeightMap* relief =
      nullptr;  ///< Heights on the same grid, whose shape shades the colours slightly.
  /// 1 for cells inside the region, on the same grid; outlined, with paler colours outside. May be
  /// empty.
  std::span<const std::uint8_t> region_mask = {};
  std::vector<MapMark> marks = {};
  PictureWords words = {};
};

/// Draws a map of differences (metres) with y up, holes grey, axes, scale bar, legend with units,
/// and the research notice. The picture shows the part of the grid with data, cropped to the region
/// and 10 cm around it. CV_8UC3, channels red, green, blue.
/// @throws std::invalid_argument if the grid is empty, or relief or region have another grid.
[[nodiscard]] cv::Mat DrawErrorImage(const HeightMap& difference,
                                     const ErrorImageOptions& options = {});

}  // namespace plumb
