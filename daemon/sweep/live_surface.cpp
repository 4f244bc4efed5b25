// SPDX-License-Identifier: Apache-2.0
#include "daemon/sweep/live_surface.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "algo/motion/region.hpp"

namespace plumb {
namespace {

constexpr std::uint32_t kMostPoints = 1'000;  // more points hardly change the mean of a cell

GridShape SquareGrid(const LiveSurfaceOptions& options) {
  if (!(options.cell_m > 0) || !(options.half_width_m > options.cell_m) ||
      !(options.distance_m > 0))
    throw std::invalid_argument("a live surface needs cells, a width and a distance above 0");
  const int cells = static_cast<int>(std::lround(2 * options.half_width_m / options.cell_m));
  return {.x_min = -options.half_width_m,
          .y_min = -options.half_width_m,
          .step = options.cell_m,
          .width = cells,
          .height = cells};
}

}  // namespace

LiveSurface::LiveSurface(const Intrinsics& intrinsics, const LiveSurfaceOptions& options)
    : intrinsics_(intrinsics),
      options_(options),
      grid_(SquareGrid(options)),
      pixel_step_(
          std::max(1, static_cast<int>(options.cell_m * intrinsics.fx / options.distance_m))),
      sum_m_(grid_.num_cells()),
      count_(grid_.num_cells()) {}

void LiveSurface::Put(const Eigen::Vector3f& p_scene) {
  if (p_scene.z() < options_.z_min_m || p_scene.z() > options_.z_max_m) return;
  const auto cell = grid_.cell(p_scene.x(), p_scene.y());
  if (!cell || count_[*cell] >= kMostPoints) return;
  sum_m_[*cell] += p_scene.z();
  ++count_[*cell];
}

void LiveSurface::Add(const Frame& frame, const TrackingReport& report) {
  if (!report.tracked) return;
  const bool is_known = report.T_scene_world.has_value();
  if (is_known && !is_placed_) {
    const Eigen::Isometry3f T_scene_world = report.T_scene_world->cast<float>();
    for (const Eigen::Vector3f& p_world : waiting_) Put(T_scene_world * p_world);
    waiting_ = {};
    is_placed_ = true;
  }
  const Eigen::Isometry3f T_target_camera =
      (is_known ? *report.T_scene_world * report.T_world_camera : report.T_world_camera)
          .cast<float>();
  const auto fx = static_cast<float>(intrinsics_.fx), fy = static_cast<float>(intrinsics_.fy);
  const auto cx = static_cast<float>(intrinsics_.cx), cy = static_cast<float>(intrinsics_.cy);
  for (int v = pixel_step_ / 2; v < frame.depth_m.rows; v += pixel_step_) {
    const float* row = frame.depth_m.ptr<float>(v);
    for (int u = pixel_step_ / 2; u < frame.depth_m.cols; u += pixel_step_) {
      const float z = row[u];
      if (!(z > 0) || z > kFarthestSurface_m) continue;
      const Eigen::Vector3f p_camera((static_cast<float>(u) - cx) / fx * z,
                                     (static_cast<float>(v) - cy) / fy * z, z);
      const Eigen::Vector3f p = T_target_camera * p_camera;
      if (is_known) {
        Put(p);
      } else if (!is_placed_ && waiting_.size() < options_.max_waiting) {
        waiting_.push_back(p);
      }
    }
  }
}

std::shared_ptr<const LiveSurfaceView> LiveSurface::View() const {
  if (!is_placed_) return nullptr;
  auto view = std::make_shared<LiveSurfaceView>();
  view->heights = HeightMap(grid_);
  view->missing.resize(region_.size());
  std::size_t wanted = 0, seen = 0;
  for (std::size_t i = 0; i < count_.size(); ++i) {
    const bool is_seen = count_[i] >= static_cast<std::uint32_t>(options_.min_points);
    if (is_seen) view->heights.z[i] = sum_m_[i] / static_cast<float>(count_[i]);
    if (region_.empty() || region_[i] == 0) continue;
    ++wanted;
    seen += is_seen ? 1 : 0;
    view->missing[i] = is_seen ? 0 : 1;
  }
  if (wanted > 0) view->coverage = static_cast<double>(seen) / static_cast<double>(wanted);
  return view;
}

std::vector<std::uint8_t> RegionToSee(const Scene& reference,
                                      const std::vector<Eigen::Vector2d>& polygon_m,
                                      const GridShape& grid) {
  if (!reference.height_map) return {};
  const HeightMap& map = *reference.height_map;
  const std::vector<std::uint8_t> mask = ReferenceRegion(reference, polygon_m);
  std::vector<double> area_m2(grid.num_cells(), 0.0);
  for (int row = 0; row < map.grid.height; ++row) {
    for (int column = 0; column < map.grid.width; ++column) {
      const auto i = static_cast<std::size_t>(row) * static_cast<std::size_t>(map.grid.width) +
                     static_cast<std::size_t>(column);
      const auto cell = grid.cell(map.grid.x_centre(column), map.grid.y_centre(row));
      if (mask[i] != 0 && cell) area_m2[*cell] += map.grid.step * map.grid.step;
    }
  }
  // A cell that the region only touches need not be seen.
  const double half_m2 = 0.5 * grid.step * grid.step;
  std::vector<std::uint8_t> region;
  if (std::ranges::none_of(area_m2, [&](double area) { return area >= half_m2; })) return region;
  region.reserve(area_m2.size());
  for (const double area : area_m2) region.push_back(area >= half_m2 ? 1 : 0);
  return region;
}

}  // namespace plumb
