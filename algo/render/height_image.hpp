// SPDX-License-Identifier: Apache-2.0
// Draws the heights of one surface.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "algo/render/picture_words.hpp"
#include "algo/types/height_map.hpp"

namespace plumb {

struct HeightImageOptions {
  std::string_view subtitle = {};
  /// 1 for cells inside the region, on the same grid; outlined, with paler colours outside. May be
  /// empty.
  std::span<const std::uint8_t> region_mask = {};
  std::optional<Eigen::Vector2d> isocentre_m = {};  ///< Marked by a cross; in the grid's frame.
  std::vector<MapMark> marks = {};
  PictureWords words = {};
};

/// Draws shaded heights (metres) with y up, holes grey, axes, scale bar, legend with units, and the
/// research notice. CV_8UC3, channels red, green, blue.
/// @throws std::invalid_argument if the grid is empty or the region has another grid.
[[nodiscard]] cv::Mat DrawHeightImage(const HeightMap& heights,
                                      const HeightImageOptions& options = {});

}  // namespace plumb
