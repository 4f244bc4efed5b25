// SPDX-License-Identifier: Apache-2.0
// Height maps on the reference marker's plane: the published method and a robust one.
#pragma once

#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "algo/base/units.hpp"
#include "algo/surface/view_surface.hpp"
#include "algo/types/height_map.hpp"
#include "algo/types/keyframe.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// A larger grid is refused.
inline constexpr double kMaxHeightMapCells = 64e6;

/// Parameters of PaperHeightMap(); the defaults are the paper's. Lengths in metres, reference
/// marker's frame.
struct HeightMapOptions {
  double x_min = -0.1;
  double x_max = 2.0;
  double y_min = -0.2;
  double y_max = 1.0;
  double cell_size = 1.5 * kMillimetre;       ///< delta
  double top_surface_band = 3 * kCentimetre;  ///< t

  /// Half-open cells: 1400 x 800 with the defaults.
  /// @throws std::invalid_argument if the crop is empty, a value is not finite or the grid exceeds
  /// 64 million cells.
  [[nodiscard]] GridShape Grid() const;
};

/// The height map as published (paper, Eqs. height_map and heightmap_h): for each cloud and cell
/// the mean z of the points within the band below the cloud's highest point there, then the mean
/// over the clouds that contain the cell. Points outside the crop and points that are not finite
/// are ignored.
/// @param clouds  One per keyframe.
/// @param T_marker_cloud  One per cloud, into the reference marker's frame (z out of the print).
/// @throws std::invalid_argument as HeightMapOptions::Grid(), if the band is not positive, or if
///         the number of poses differs from the number of clouds.
/// Deterministic on any number of threads.
[[nodiscard]] HeightMap PaperHeightMap(std::span<const PointCloud> clouds,
                                       std::span<const Pose> T_marker_cloud,
                                       const HeightMapOptions& options = {});

/// Parameters of RobustHeightMap(). Lengths in metres, reference marker's frame.
struct RobustHeightMapOptions {
  double cell_size = 1.5 * kMillimetre;
  /// Fixed grid; not set: around the data, with cell borders at multiples of cell_size.
  std::optional<GridShape> grid = std::nullopt;
  double max_extent = 4.0;  ///< Largest extent of a grid found from the data, in each direction.
  double z_min = -0.3;      ///< Height crop: floor under a couch, ...
  double z_max = 0.8;       ///< ... hands, cables, lamps above the body.
  double top_surface_band = 3 * kCentimetre;
  int min_views = 2;  ///< Number of views that must agree on a cell (at most the number available).
  /// Square metres; smaller isolated patches are removed as speckles.
  double min_patch_area = 4e-4;
  std::stop_token stop = {};  ///< Polled; see CheckStop().
};

/// The top surface as all views together show it.
///
/// Coarse cells (4 x 4 fine ones) find the top: the highest band that several measurements support,
/// not the highest point. Small isolated patches are removed. Every fine cell is then a seed on the
/// coarse cell's plane that is moved to the robust, noise-weighted mean of what the views measured
/// there (ViewFusion), so that a cell's height is sampled at its centre and a keyframe that saw
/// something lower has no influence. Nothing is filled: cells outside measured coarse cells remain
/// NaN.
///
/// @param views_in_marker  Prepared views whose "world" is the reference marker's frame.
/// @throws std::invalid_argument if an option is out of range.
/// Deterministic on any number of threads.
[[nodiscard]] HeightMap RobustHeightMap(std::span<const ViewSurface> views_in_marker,
                                        const RobustHeightMapOptions& options = {});

}  // namespace plumb
