// SPDX-License-Identifier: Apache-2.0
// Triangles over a height map.
#pragma once

#include <span>
#include <vector>

#include "algo/types/height_map.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

struct SurfaceMeshOptions {
  int decimation = 1;  ///< Every n-th row and column becomes a vertex; >= 1.
};

/// Mesh of the valid cells' centres in the map's frame: two triangles (or one, where a corner is
/// missing) for each square of four neighbours, none across steps or holes, counter-clockwise seen
/// from +z. Vertices without a triangle are left out; normals are the area-weighted mean of the
/// surrounding triangles.
/// @param colors  Empty, or one per cell.
/// @throws std::invalid_argument if the decimation is out of range, or if there are colours, but
/// not
///         one for each cell.
[[nodiscard]] TriangleMesh MeshOfHeightMap(const HeightMap& map, std::span<const Color> colors = {},
                                           const SurfaceMeshOptions& options = {});

/// Colours for the cells of a height map from a cloud in the same frame. Each valid cell takes the
/// colour of the point nearest in height in its own cell, otherwise from the nearest neighbour cell
/// up to two cells away; black if there is none. Empty if the cloud has no colours.
/// @param decimation  As of the mesh: cells of other rows and columns stay black.
[[nodiscard]] std::vector<Color> ColorsFromCloud(const HeightMap& map, const PointCloud& cloud,
                                                 int decimation = 1);

}  // namespace plumb
