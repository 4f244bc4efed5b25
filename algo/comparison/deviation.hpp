// SPDX-License-Identifier: Apache-2.0
// Height and distance differences of two surfaces on one grid.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include "algo/types/height_map.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Resamples a height map in another frame: its surface (triangles between neighbouring cells, none
/// across jumps) is moved by T_target_source (rigid apart from a small stretch) and drawn from
/// above onto the target grid, where the highest surface is kept. NaN where no surface is drawn.
[[nodiscard]] HeightMap ResampledHeightMap(const HeightMap& source,
                                           const Eigen::Affine3d& T_target_source,
                                           const GridShape& target);

/// Height map of a cloud with normals: each point draws its tangent disc of radius `reach_m`, and
/// each cell takes the weighted mean within 1 cm of the highest. Used for scans without a height
/// map.
[[nodiscard]] HeightMap HeightMapOfCloud(const PointCloud& cloud_in_target, double reach_m,
                                         const GridShape& target);

/// Current minus reference where both are known, NaN elsewhere.
/// @throws std::invalid_argument if the grids differ.
[[nodiscard]] HeightMap HeightDifference(const HeightMap& current, const HeightMap& reference);

/// Distance from the surface point of each reference cell to the nearest point of the current
/// surface, metres; positive where the current surface lies outside (above). Unlike a height
/// difference it is not inflated on flanks by a sideways shift. NaN where the reference is unknown,
/// its mask is 0, or the current surface ends nearby.
/// @param mask  One value per cell; empty: all cells.
/// @throws std::invalid_argument if the grids or the mask's size differ.
[[nodiscard]] HeightMap SignedDistance(const HeightMap& current, const HeightMap& reference,
                                       const std::vector<std::uint8_t>& mask = {});

}  // namespace plumb
