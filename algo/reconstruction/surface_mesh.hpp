// Triangles over a height map.
#pragma once

#include <span>
#include <vector>

#include "algo/types/height_map.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

struct SurfaceMeshOptions {
  int decimation = 1;            ///< Every n-th row and column becomes a vertex; >= 1.
  double max_slope_deg = 80.0;   ///< Triangles with a steeper edge are steps between surfaces and
                                 ///< are left out; in (0, 90).
  double step_margin_m = 0.003;  ///< Height difference that noise may add to an edge of that slope.
};

/// Mesh of the valid cells' centres in the map's frame: two triangles (or one, where a corner is
/// missing) for each square of four neighbours, none across steps or holes, counter-clockwise seen
/// from +z. Vertices without triangle are left out; normals are the area-weighted mean of the
/// triangles around.
/// @param colors  Empty, or one a cell.
/// @throws std::invalid_argument if an option is out of range or the number of colours differs from
/// the cells'.
[[nodiscard]] TriangleMesh MeshOfHeightMap(const HeightMap& map, std::span<const Color> colors = {},
                                           const SurfaceMeshOptions& options = {});

/// Colours for the cells of a height map from a cloud in the same frame: each valid cell takes the
/// colour of the cloud's point that is nearest to it in height among the points in its own cell,
/// else from the nearest of its neighbours up to two cells away; black where there is none. Empty
/// if the cloud has no colours.
[[nodiscard]] std::vector<Color> ColorsFromCloud(const HeightMap& map, const PointCloud& cloud);

}  // namespace plumb
