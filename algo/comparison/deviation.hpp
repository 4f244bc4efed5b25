// Height and distance differences of two surfaces on one grid.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include "algo/types/height_map.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// A height map seen in another frame: its surface (triangles between neighbouring cells, none
/// across jumps) moved by T_target_source (rigid but for a small stretch) and drawn onto the target
/// grid from above, the highest sheet winning. NaN where it does not reach.
[[nodiscard]] HeightMap ResampledHeightMap(const HeightMap& source,
                                           const Eigen::Affine3d& T_target_source,
                                           const GridShape& target);

/// Height map of a cloud with normals: each point paints its tangent disc of `reach_m`; cells take
/// the weighted mean of what lies within 1 cm of the highest. For scans that have no height map of
/// their own.
[[nodiscard]] HeightMap HeightMapOfCloud(const PointCloud& cloud_in_target, double reach_m,
                                         const GridShape& target);

/// current - reference where both are known, NaN elsewhere. Grids must be equal.
/// @throws std::invalid_argument if they are not.
[[nodiscard]] HeightMap HeightDifference(const HeightMap& current, const HeightMap& reference);

/// Distance from each reference cell's surface point to the nearest point of the current surface,
/// metres; > 0 where the current surface lies outside (above). A vertical difference is no
/// distance: a shift of 10 mm sideways changes heights on a flank by far more. NaN where the
/// reference is unknown, its mask is 0, or the current surface ends before it comes near.
/// @param mask  Of the grid's cells; empty: all.
/// @throws std::invalid_argument if the grids or the mask's size differ.
[[nodiscard]] HeightMap SignedDistance(const HeightMap& current, const HeightMap& reference,
                                       const std::vector<std::uint8_t>& mask = {});

}  // namespace plumb
