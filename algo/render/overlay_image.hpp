// SPDX-License-Identifier: Apache-2.0
// Draws both surfaces in one picture.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/base/units.hpp"
#include "algo/render/picture_words.hpp"
#include "algo/types/height_map.hpp"
#include "algo/verdict/default_tolerance.hpp"

namespace plumb {

struct OverlayImageOptions {
  /// Surfaces closer than this are drawn as one (violet); > 0.
  double tolerance_m = kDefaultShiftTolerance_mm * kMillimetre;
  std::string subtitle = {};
  /// 1 for cells inside the region, on the same grid; the picture is cropped to it and 10 cm around
  /// it.
  std::span<const std::uint8_t> region_mask = {};
  std::vector<MapMark> marks = {};
  PictureWords words = {};
};

/// Draws two height maps of one grid as shaded surfaces: reference blue, current red. Where both
/// are present, the colour of the upper one is used, blended to violet where they agree within the
/// tolerance. Holes are grey; y points up; with axes, scale bar, legend and the research notice.
/// CV_8UC3, channels red, green, blue.
/// @throws std::invalid_argument if the grids differ or are empty, the region has another grid, or
///         the tolerance is not above 0.
[[nodiscard]] cv::Mat DrawOverlayImage(const HeightMap& reference, const HeightMap& current,
                                       const OverlayImageOptions& options = {});

}  // namespace plumb
