// SPDX-License-Identifier: Apache-2.0
#include "algo/surface/height_maps.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <tbb/parallel_for.h>

namespace plumb {
namespace {

constexpr int kMaxRowsPerBand = 64;  // rows of cells in one task

/// Highest point of one cloud in one cell, and the band below it.
struct CellTop {
  float highest = 0.0F;
  float sum = 0.0F;  // sum of z - highest, with the highest at the time of summing
  int count = 0;
};

/// A point of one cloud that falls into the grid.
struct CellPoint {
  std::uint32_t cell;
  float z;
};

/// Bands of rows, which can be processed independently.
struct RowBands {
  explicit RowBands(const GridShape& grid)
      : count(static_cast<std::size_t>((grid.height + kMaxRowsPerBand - 1) / kMaxRowsPerBand)),
        cells(static_cast<std::size_t>(kMaxRowsPerBand) * static_cast<std::size_t>(grid.width)) {}
  std::size_t count;
  std::size_t cells;  ///< In each band but the last, which may have fewer.
};

using PointsOfBands = std::vector<std::vector<CellPoint>>;

PointsOfBands SortIntoBands(const PointCloud& cloud, const Pose& T_marker_cloud,
                            const GridShape& grid, const RowBands& bands) {
  const Eigen::Matrix3f R = T_marker_cloud.linear().cast<float>();
  const Eigen::Vector3f t = T_marker_cloud.translation().cast<float>();
  PointsOfBands points(bands.count);
  for (auto& in_band : points) in_band.reserve(cloud.size() / bands.count * 2);
  for (const Eigen::Vector3f& p_cloud : cloud.points) {
    const Eigen::Vector3f p = R * p_cloud + t;
    if (!std::isfinite(p.z())) continue;
    if (const auto cell = grid.cell(p.x(), p.y()))
      points[*cell / bands.cells].push_back(
          {static_cast<std::uint32_t>(*cell % bands.cells), p.z()});
  }
  return points;
}

// Each cell's mean over the clouds, in their order, of the mean height of the cloud's points that
// lie within `depth_m` of its highest.
void FillBand(const std::vector<PointsOfBands>& points, std::size_t band, const RowBands& bands,
              float depth_m, HeightMap& map) {
  const std::size_t first_cell = band * bands.cells;
  const std::size_t num_cells = std::min(bands.cells, map.grid.num_cells() - first_cell);
  std::vector<CellTop> tops(num_cells);
  std::vector<float> sum_of_means(num_cells, 0.0F);
  std::vector<std::uint16_t> num_means(num_cells, 0);
  for (const PointsOfBands& cloud : points) {
    const std::vector<CellPoint>& in_band = cloud[band];
    for (const CellPoint& p : in_band) {
      CellTop& top = tops[p.cell];
      top.highest = top.count == 0 ? p.z : std::max(top.highest, p.z);
      top.count = 1;
    }
    for (const CellPoint& p : in_band) {
      CellTop& top = tops[p.cell];
      if (!(top.highest - p.z < depth_m)) continue;
      top.sum += p.z - top.highest;
      ++top.count;  // one more than the number of points; 1 marks a touched cell
    }
    for (const CellPoint& p : in_band) {
      CellTop& top = tops[p.cell];
      if (top.count < 2) continue;
      sum_of_means[p.cell] += top.highest + top.sum / static_cast<float>(top.count - 1);
      ++num_means[p.cell];
      top = {};
    }
  }
  for (std::size_t c = 0; c < num_cells; ++c)
    if (num_means[c] > 0)
      map.z[first_cell + c] = sum_of_means[c] / static_cast<float>(num_means[c]);
}

}  // namespace

GridShape HeightMapOptions::Grid() const {
  const double columns = std::round((x_max - x_min) / cell_size);
  const double rows = std::round((y_max - y_min) / cell_size);
  if (!(cell_size > 0.0 && columns >= 1.0 && rows >= 1.0 && columns * rows <= kMaxHeightMapCells))
    throw std::invalid_argument("height map: crop or cell size out of range");
  GridShape grid;
  grid.x_min = x_min;
  grid.y_min = y_min;
  grid.step = cell_size;
  grid.width = static_cast<int>(columns);
  grid.height = static_cast<int>(rows);
  return grid;
}

HeightMap PaperHeightMap(std::span<const PointCloud> clouds, std::span<const Pose> T_marker_cloud,
                         const HeightMapOptions& options) {
  if (clouds.size() != T_marker_cloud.size())
    throw std::invalid_argument("height map: the numbers of clouds and poses differ");
  const GridShape grid = options.Grid();
  if (!(options.top_surface_band > 0.0))
    throw std::invalid_argument("height map: the top surface band is not positive");
  const float band = static_cast<float>(options.top_surface_band);

  const RowBands bands(grid);
  std::vector<PointsOfBands> points(clouds.size());
  tbb::parallel_for(std::size_t{0}, clouds.size(), [&](std::size_t j) {
    points[j] = SortIntoBands(clouds[j], T_marker_cloud[j], grid, bands);
  });
  HeightMap map(grid);
  tbb::parallel_for(std::size_t{0}, bands.count,
                    [&](std::size_t b) { FillBand(points, b, bands, band, map); });
  return map;
}

}  // namespace plumb
