// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <stdexcept>

#include <tbb/parallel_for.h>

#include "algo/base/check_stop.hpp"
#include "algo/surface/height_maps.hpp"
#include "algo/surface/view_fusion.hpp"

namespace plumb {
namespace {

constexpr int kCoarse =
    4;  // fine cells per coarse cell in each direction: 6 mm, about 1.7 working pixels at 1 m
// coarse cells per tile in each direction; the cells of a tile share one list of views
constexpr int kTile = 8;
constexpr double kExtentCell = 0.05;  // metres; raster cell for finding the extent of the data
constexpr int kMinExtentCount =
    30;  // samples for a raster cell to count (a surface at 1 m gives 200 per view)
constexpr std::size_t kMaxTopSamples =
    1'500'000;  // limit for the coarse tops; views are thinned evenly to it
constexpr float kMinTopFraction =
    0.2F;  // fraction of a coarse cell's samples that must support the top
constexpr std::size_t kMinTopCount = 2;
constexpr float kMinNormalZ = 0.17F;  // flanks steeper than 80 deg are given no height
constexpr int kMaxViews = 12;         // views used for one cell
constexpr float kMaxMeanSlope =
    2.0F;  // tan of 63 deg; means of the corners are not used over steeper squares
constexpr int kMinTopNeighbours =
    5;  // of the 8 neighbours of an empty coarse cell; enough to try to measure it

/// A measured working pixel in a coarse cell.
struct TopSample {
  std::uint32_t cell;  ///< Index within its row of tiles.
  float z;
  std::uint32_t view;
  std::uint32_t pixel;
};

/// The top surface in a coarse cell as a plane through its mean point; count 0 means empty.
struct TopPlane {
  Eigen::Vector3f point = Eigen::Vector3f::Zero();
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();
  int count = 0;
};

struct CoarseMap {
  GridShape grid;
  std::vector<TopPlane> cells;
};

struct Window {
  double first;  ///< metres
  double last;
};

/// The section of the histogram with data, at most `max_extent` long, cut around the origin.
std::optional<Window> DataWindow(const std::vector<std::int64_t>& counts, double start,
                                 double max_extent) {
  const auto filled = [](std::int64_t count) { return count > 0; };
  const auto first = std::find_if(counts.begin(), counts.end(), filled);
  if (first == counts.end()) return std::nullopt;
  std::ptrdiff_t a = first - counts.begin();
  std::ptrdiff_t b = counts.rend() - std::find_if(counts.rbegin(), counts.rend(), filled);
  const std::ptrdiff_t longest =
      std::max<std::ptrdiff_t>(1, static_cast<std::ptrdiff_t>(max_extent / kExtentCell));
  if (b - a > longest) {
    // The window with the most data among those that contain the marker.
    const std::ptrdiff_t origin = static_cast<std::ptrdiff_t>(-start / kExtentCell);
    std::int64_t best = -1;
    std::ptrdiff_t best_start = a;
    for (std::ptrdiff_t s = std::max(a, origin - longest + 1); s <= std::min(b - longest, origin);
         ++s) {
      std::int64_t sum = 0;
      for (std::ptrdiff_t i = s; i < s + longest; ++i) sum += counts[static_cast<std::size_t>(i)];
      if (sum > best) {
        best = sum;
        best_start = s;
      }
    }
    a = best_start;
    b = a + longest;
  }
  return Window{start + static_cast<double>(a) * kExtentCell,
                start + static_cast<double>(b) * kExtentCell};
}

Eigen::Matrix3f RotationOf(const ViewSurface& view) {
  return view.T_world_camera.linear().cast<float>();
}
Eigen::Vector3f TranslationOf(const ViewSurface& view) {
  return view.T_world_camera.translation().cast<float>();
}

/// Grid around the samples' bounding box; nothing if there are none.
std::optional<GridShape> GridAroundData(std::span<const ViewSurface> views,
                                        const RobustHeightMapOptions& options) {
  GridShape raster;
  raster.step = kExtentCell;
  raster.width = raster.height = 2 * static_cast<int>(std::ceil(options.max_extent / kExtentCell));
  raster.x_min = raster.y_min = -0.5 * raster.width * raster.step;
  std::vector<std::vector<std::uint32_t>> counts(views.size());
  tbb::parallel_for(std::size_t{0}, views.size(), [&](std::size_t v) {
    counts[v].assign(raster.num_cells(), 0);
    const ViewSurface& view = views[v];
    const Eigen::Matrix3f R = RotationOf(view);
    const Eigen::Vector3f t = TranslationOf(view);
    for (std::size_t i = 0; i < view.size(); i += 3) {
      if (view.pixels[i].weight <= 0.0F) continue;
      const Eigen::Vector3f p = R * view.PointInCamera(i) + t;
      if (p.z() < options.z_min || p.z() > options.z_max) continue;
      if (const auto cell = raster.cell(p.x(), p.y())) counts[v][*cell] += 3;
    }
  });
  std::vector<std::int64_t> columns(static_cast<std::size_t>(raster.width), 0);
  std::vector<std::int64_t> rows(static_cast<std::size_t>(raster.height), 0);
  for (std::size_t c = 0; c < raster.num_cells(); ++c) {
    std::int64_t sum = 0;
    for (const auto& of_view : counts) sum += of_view[c];
    if (sum < kMinExtentCount) continue;
    columns[c % columns.size()] += sum;
    rows[c / columns.size()] += sum;
  }
  const auto x = DataWindow(columns, raster.x_min, options.max_extent);
  const auto y = DataWindow(rows, raster.y_min, options.max_extent);
  if (!x || !y) return std::nullopt;
  // Borders at multiples of the cell size, so that the grids of two scenes coincide.
  const double step = options.cell_size;
  const double first_column = std::floor(x->first / step);
  const double first_row = std::floor(y->first / step);
  GridShape grid;
  grid.step = step;
  grid.x_min = first_column * step;
  grid.y_min = first_row * step;
  grid.width = static_cast<int>(std::ceil(x->last / step) - first_column);
  grid.height = static_cast<int>(std::ceil(y->last / step) - first_row);
  return grid;
}

GridShape CoarseGrid(const GridShape& fine) {
  GridShape coarse = fine;
  coarse.step = fine.step * kCoarse;
  coarse.width = (fine.width + kCoarse - 1) / kCoarse;
  coarse.height = (fine.height + kCoarse - 1) / kCoarse;
  return coarse;
}

/// Samples of one view, by rows of tiles.
void SortIntoRows(const ViewSurface& view, std::uint32_t index, std::size_t stride,
                  const GridShape& coarse, const RobustHeightMapOptions& options,
                  std::vector<std::vector<TopSample>>& rows) {
  const Eigen::Matrix3f R = RotationOf(view);
  const Eigen::Vector3f t = TranslationOf(view);
  const std::size_t cells_per_row = static_cast<std::size_t>(coarse.width) * kTile;
  // A stride coprime to the image's width spreads the kept pixels over the columns.
  for (std::size_t i = index % stride; i < view.size(); i += stride) {
    if (view.pixels[i].inverse_depth <= 0.0F)
      // rims and grazing views are included: they show that something is there
      continue;
    const Eigen::Vector3f p = R * view.PointInCamera(i) + t;
    if (p.z() < options.z_min || p.z() > options.z_max) continue;
    if (const auto cell = coarse.cell(p.x(), p.y()))
      rows[*cell / cells_per_row].push_back({static_cast<std::uint32_t>(*cell % cells_per_row),
                                             p.z(), index, static_cast<std::uint32_t>(i)});
  }
}

/// Number of different views among the samples. Views whose indices differ by 64 count as one,
/// which only makes the test stricter.
int NumViews(std::span<const TopSample> samples) {
  std::uint64_t seen = 0;
  for (const TopSample& sample : samples) seen |= std::uint64_t{1} << (sample.view % 64);
  return std::popcount(seen);
}

/// The highest band of samples that has support, as a plane. `samples` are those of one cell and
/// are reordered.
TopPlane FindTop(std::span<TopSample> samples, std::span<const ViewSurface> views, float band,
                 int min_views) {
  TopPlane top;
  // Highest first, equal heights in input order, independent of the sorting algorithm.
  std::sort(samples.begin(), samples.end(), [](const TopSample& a, const TopSample& b) {
    return a.z != b.z ? a.z > b.z : (a.view != b.view ? a.view < b.view : a.pixel < b.pixel);
  });
  const std::size_t needed = std::max(
      kMinTopCount, static_cast<std::size_t>(kMinTopFraction * static_cast<float>(samples.size())));
  std::size_t end = 0;
  for (std::size_t begin = 0; begin + needed <= samples.size(); ++begin) {
    end = std::max(end, begin);
    while (end < samples.size() && samples[begin].z - samples[end].z < band) ++end;
    if (end - begin < needed || NumViews(samples.subspan(begin, end - begin)) < min_views) continue;
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    float weight_sum = 0.0F;
    for (std::size_t k = begin; k < end; ++k) {
      const ViewSurface& view = views[samples[k].view];
      const std::size_t i = samples[k].pixel;
      const float weight = view.pixels[i].weight;
      if (weight <= 0.0F) continue;
      ++top.count;
      const Eigen::Matrix3f R = RotationOf(view);
      top.point += weight * (R * view.PointInCamera(i) + TranslationOf(view));
      normal += weight * (R * view.normals[i].Unit());
      weight_sum += weight;
    }
    // The top is seen only at rims or is too steep: no height, and nothing below it either.
    const float length = normal.norm();
    if (!(weight_sum > 0.0F && normal.z() > kMinNormalZ * length)) return {};
    top.point /= weight_sum;
    top.normal = normal / length;
    break;
  }
  return top;
}

CoarseMap FindTops(std::span<const ViewSurface> views, const GridShape& fine,
                   const RobustHeightMapOptions& options) {
  CoarseMap map;
  map.grid = CoarseGrid(fine);
  map.cells.resize(map.grid.num_cells());
  std::size_t total = 0;
  for (const ViewSurface& view : views) total += view.size();
  std::size_t stride = (total + kMaxTopSamples - 1) / kMaxTopSamples;
  if (stride > 1) stride |= 1U;  // odd, so that it has no factor in common with the usual widths
  const std::size_t num_rows = static_cast<std::size_t>((map.grid.height + kTile - 1) / kTile);
  std::vector<std::vector<std::vector<TopSample>>> samples(
      views.size(), std::vector<std::vector<TopSample>>(num_rows));
  tbb::parallel_for(std::size_t{0}, views.size(), [&](std::size_t v) {
    CheckStop(options.stop);
    SortIntoRows(views[v], static_cast<std::uint32_t>(v), std::max<std::size_t>(1, stride),
                 map.grid, options, samples[v]);
  });
  const float band = static_cast<float>(options.top_surface_band);
  const int min_views = std::min(options.min_views, static_cast<int>(views.size()));
  const std::size_t cells_per_row = static_cast<std::size_t>(map.grid.width) * kTile;
  tbb::parallel_for(std::size_t{0}, num_rows, [&](std::size_t row) {
    CheckStop(options.stop);
    const std::size_t first = row * cells_per_row;
    const std::size_t num_cells = std::min(cells_per_row, map.cells.size() - first);
    std::vector<std::uint32_t> starts(num_cells + 1, 0);
    for (const auto& of_view : samples)
      for (const TopSample& sample : of_view[row]) ++starts[sample.cell + 1];
    for (std::size_t c = 0; c < num_cells; ++c) starts[c + 1] += starts[c];
    std::vector<TopSample> sorted(starts[num_cells]);
    std::vector<std::uint32_t> next(starts.begin(), starts.end() - 1);
    for (const auto& of_view : samples)
      for (const TopSample& sample : of_view[row]) sorted[next[sample.cell]++] = sample;
    for (std::size_t c = 0; c < num_cells; ++c)
      map.cells[first + c] = FindTop(
          std::span(sorted).subspan(starts[c], starts[c + 1] - starts[c]), views, band, min_views);
  });
  return map;
}

/// Empty cells that are nearly surrounded get the plane of their neighbours as a seed only; their
/// height is still measured or stays empty.
void SeedGaps(CoarseMap& map) {
  const int width = map.grid.width;
  const std::vector<TopPlane> before = map.cells;
  for (int row = 1; row + 1 < map.grid.height; ++row) {
    for (int column = 1; column + 1 < width; ++column) {
      const std::size_t i = map.grid.index(row, column);
      if (before[i].count > 0) continue;
      TopPlane sum;
      sum.normal.setZero();
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const TopPlane& other = before[i + static_cast<std::size_t>(dy * width + dx)];
          if (other.count == 0) continue;
          sum.point += other.point;
          sum.normal += other.normal;
          ++sum.count;
        }
      }
      if (sum.count < kMinTopNeighbours) continue;
      sum.point /= static_cast<float>(sum.count);
      sum.normal.normalize();
      map.cells[i] = sum;
    }
  }
}

/// Removes patches smaller than `min_cells` that no continuous surface connects to others.
void DropSpeckles(CoarseMap& map, float max_step, std::size_t min_cells) {
  const int width = map.grid.width;
  std::vector<std::uint8_t> seen(map.cells.size(), 0);
  std::vector<std::size_t> patch;
  for (std::size_t start = 0; start < map.cells.size(); ++start) {
    if (seen[start] != 0 || map.cells[start].count == 0) continue;
    patch.assign(1, start);
    seen[start] = 1;
    for (std::size_t k = 0; k < patch.size(); ++k) {
      const int row = static_cast<int>(patch[k] / static_cast<std::size_t>(width));
      const int column = static_cast<int>(patch[k] % static_cast<std::size_t>(width));
      for (const auto& [dy, dx] :
           {std::pair(-1, 0), std::pair(0, -1), std::pair(0, 1), std::pair(1, 0)}) {
        if (!map.grid.contains(row + dy, column + dx)) continue;
        const std::size_t j = map.grid.index(row + dy, column + dx);
        if (seen[j] != 0 || map.cells[j].count == 0 ||
            std::abs(map.cells[j].point.z() - map.cells[patch[k]].point.z()) > max_step)
          continue;
        seen[j] = 1;
        patch.push_back(j);
      }
    }
    if (patch.size() >= min_cells) continue;
    for (const std::size_t i : patch) map.cells[i] = {};
  }
}

/// Measures the fine cells tile by tile: every second one in each direction by fusion (3 mm, the
/// resolution of the sensor), the others by the mean of their neighbours where these lie on one
/// surface, otherwise also by fusion.
class MapFiller {
 public:
  MapFiller(std::span<const ViewSurface> views, const CoarseMap& coarse,
            const RobustHeightMapOptions& options, HeightMap& map)
      : coarse_(coarse),
        options_(options),
        band_(static_cast<float>(options.top_surface_band)),
        max_step_(kMaxMeanSlope * static_cast<float>(2.0 * options.cell_size)),
        min_views_(std::min(options.min_views, static_cast<int>(views.size()))),
        fusion_(views, {.with_normals = false, .max_views = kMaxViews}),
        map_(map) {}

  void Fill() {
    const int tile_rows = (coarse_.grid.height + kTile - 1) / kTile;
    const int tile_columns = (coarse_.grid.width + kTile - 1) / kTile;
    tbb::parallel_for(0, tile_rows, [&](int row) {
      CheckStop(options_.stop);
      for (int column = 0; column < tile_columns; ++column) FillTile(row, column, true);
    });
    // Written to another array, so that cells do not depend on the order of processing.
    nodes_ = map_.z;
    tbb::parallel_for(0, tile_rows, [&](int row) {
      CheckStop(options_.stop);
      for (int column = 0; column < tile_columns; ++column) FillTile(row, column, false);
    });
  }

 private:
  [[nodiscard]] std::size_t Index(int row, int column) const {
    return map_.grid.index(row, column);
  }
  [[nodiscard]] const TopPlane& PlaneAt(int row, int column) const {
    return coarse_.cells[coarse_.grid.index(row, column)];
  }

  void FillTile(int tile_row, int tile_column, bool is_node_pass) {
    const int row_end = std::min((tile_row + 1) * kTile, coarse_.grid.height);
    const int column_end = std::min((tile_column + 1) * kTile, coarse_.grid.width);
    Eigen::AlignedBox3f box;
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    for (int row = tile_row * kTile; row < row_end; ++row) {
      for (int column = tile_column * kTile; column < column_end; ++column) {
        if (PlaneAt(row, column).count == 0) continue;
        box.extend(PlaneAt(row, column).point);
        normal += PlaneAt(row, column).normal;
      }
    }
    if (box.isEmpty()) return;
    std::vector<std::uint16_t> near;
    fusion_.ViewsNear(box.center(),
                      0.5F * box.diagonal().norm() + static_cast<float>(coarse_.grid.step),
                      normal.normalized(), near);
    for (int row = tile_row * kTile; row < row_end; ++row)
      for (int column = tile_column * kTile; column < column_end; ++column)
        if (PlaneAt(row, column).count > 0) FillCoarseCell(row, column, near, is_node_pass);
  }

  void FillCoarseCell(int coarse_row, int coarse_column, std::span<const std::uint16_t> near,
                      bool is_node_pass) {
    const GridShape& grid = map_.grid;
    for (int row = coarse_row * kCoarse; row < std::min((coarse_row + 1) * kCoarse, grid.height);
         ++row) {
      for (int column = coarse_column * kCoarse;
           column < std::min((coarse_column + 1) * kCoarse, grid.width); ++column) {
        const bool is_node = row % 2 == 0 && column % 2 == 0;
        if (is_node != is_node_pass) continue;
        if (!is_node && MeanOfNodes(row, column)) continue;
        Measure(row, column, PlaneAt(coarse_row, coarse_column), near);
      }
    }
  }

  /// Sets a cell between nodes to their mean; false if one is missing or on another surface.
  bool MeanOfNodes(int row, int column) {
    const int row_before = row - row % 2;
    const int row_after = row + row % 2;
    const int column_before = column - column % 2;
    const int column_after = column + column % 2;
    if (row_after >= map_.grid.height || column_after >= map_.grid.width) return false;
    const std::array<std::size_t, 4> around = {
        Index(row_before, column_before), Index(row_before, column_after),
        Index(row_after, column_before), Index(row_after, column_after)};
    float lowest = nodes_[around[0]];
    float highest = lowest;
    float sum = 0.0F;
    for (const std::size_t i : around) {
      if (std::isnan(nodes_[i])) return false;
      lowest = std::min(lowest, nodes_[i]);
      highest = std::max(highest, nodes_[i]);
      sum += nodes_[i];
    }
    if (highest - lowest > max_step_) return false;
    map_.at(row, column) = 0.25F * sum;
    return true;
  }

  void Measure(int row, int column, const TopPlane& plane, std::span<const std::uint16_t> near) {
    const GridShape& grid = map_.grid;
    Eigen::Vector3f seed(static_cast<float>(grid.x_centre(column)),
                         static_cast<float>(grid.y_centre(row)), plane.point.z());
    const Eigen::Vector3f& n = plane.normal;
    seed.z() -=
        (n.x() * (seed.x() - plane.point.x()) + n.y() * (seed.y() - plane.point.y())) / n.z();
    const FusedPoint fused = fusion_.Fuse(seed, n, near);
    if (fused.num_agreeing < min_views_ || fused.num_through > fused.num_agreeing ||
        fused.weight <= 0.0F)
      return;
    const float rise = fused.offset_m / n.z();
    if (!(std::abs(rise) <= band_ && seed.z() + rise >= options_.z_min &&
          seed.z() + rise <= options_.z_max))
      return;
    map_.at(row, column) = seed.z() + rise;
  }

  const CoarseMap& coarse_;
  const RobustHeightMapOptions& options_;
  float band_;
  float max_step_;
  int min_views_;
  ViewFusion fusion_;
  HeightMap& map_;
  std::vector<float> nodes_;
};

}  // namespace

HeightMap RobustHeightMap(std::span<const ViewSurface> views_in_marker,
                          const RobustHeightMapOptions& options) {
  if (!(options.cell_size > 0.0 && options.max_extent > 0.0 && options.max_extent <= 20.0 &&
        options.z_min < options.z_max && options.top_surface_band > 0.0 && options.min_views >= 1 &&
        options.min_patch_area >= 0.0))
    throw std::invalid_argument("robust height map: an option is out of range");
  std::optional<GridShape> grid = options.grid;
  if (!grid) grid = GridAroundData(views_in_marker, options);
  if (!grid) return HeightMap();
  if (!(grid->width > 0 && grid->height > 0 && grid->step > 0.0 &&
        static_cast<double>(grid->width) * grid->height <= kMaxHeightMapCells))
    throw std::invalid_argument("robust height map: grid out of range");
  HeightMap map(*grid);
  if (views_in_marker.empty()) return map;

  CoarseMap coarse = FindTops(views_in_marker, *grid, options);
  CheckStop(options.stop);
  SeedGaps(coarse);
  DropSpeckles(
      coarse, static_cast<float>(options.top_surface_band),
      static_cast<std::size_t>(options.min_patch_area / (coarse.grid.step * coarse.grid.step)));
  CheckStop(options.stop);
  MapFiller(views_in_marker, coarse, options, map).Fill();
  return map;
}

}  // namespace plumb
