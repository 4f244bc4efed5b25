// Both surfaces in one picture.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/base/units.hpp"
#include "algo/render/picture_words.hpp"
#include "algo/types/height_map.hpp"

namespace plumb {

struct OverlayImageOptions {
  double tolerance_m = 3 * kMillimetre;  ///< Surfaces closer than this look like one (violet); > 0.
  std::string subtitle = {};
  std::span<const std::uint8_t> region_mask = {};  ///< Cells inside the region (1), as the grid:
                                                   ///< with 10 cm around it they fill the picture.
  std::vector<MapMark> marks = {};
  PictureWords words = {};
};

/// Draws two height maps of one grid as shaded surfaces: reference blue, current red, where both
/// are: the colour of the one on top, blending to violet where they agree within the tolerance;
/// holes grey; y up, axes, scale bar, legend and the research notice. CV_8UC3, channels red, green,
/// blue.
/// @throws std::invalid_argument if the grids differ or are empty, the region has another grid, or
/// the tolerance is not above 0.
[[nodiscard]] cv::Mat DrawOverlayImage(const HeightMap& reference, const HeightMap& current,
                                       const OverlayImageOptions& options = {});

}  // namespace plumb
