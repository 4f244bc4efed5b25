// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/live_map.hpp"

#include <cmath>
#include <limits>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

// About two blocks of a sensor a metre away.
constexpr double kMapCell_m = 2 * kCentimetre;
constexpr double kMapHalfWidth_m = 1.6;
constexpr double kMostRise_m = 5 * kCentimetre;  // beyond it is something else
constexpr float kSteep = 0.3F;                   // vertical part of the normal

GridShape MapGrid() {
  const int cells = static_cast<int>(std::lround(2 * kMapHalfWidth_m / kMapCell_m));
  return {.x_min = -kMapHalfWidth_m,
          .y_min = -kMapHalfWidth_m,
          .step = kMapCell_m,
          .width = cells,
          .height = cells};
}

}  // namespace

LiveMap MakeLiveMap(std::span<const FitView> views) {
  LiveMap map{.rise_m = HeightMap(MapGrid())};
  const std::size_t cells = map.rise_m.grid.num_cells();
  map.missing.assign(cells, 0);
  std::vector<float> sum_m(cells, 0.0F), count(cells, 0.0F);
  for (const FitView& view : views) {
    for (std::size_t b = 0; b < view.grid.size(); ++b) {
      const Eigen::Vector3f& expected = view.model.point[b];
      const Eigen::Vector3f& normal = view.model.normal[b];
      if (view.model.part[b] != SurfacePart::kRegion || normal.z() < kSteep) continue;
      const auto cell = map.rise_m.grid.cell(expected.x(), expected.y());
      if (!cell) continue;
      const auto seen = MeasuredPoint(view, b);
      const float rise_m = seen ? normal.dot(seen->cast<float>() - expected) / normal.z()
                                : std::numeric_limits<float>::quiet_NaN();
      if (!(std::abs(rise_m) <= kMostRise_m)) {
        map.missing[*cell] = 1;
        continue;
      }
      sum_m[*cell] += rise_m;
      count[*cell] += 1.0F;
    }
  }
  for (std::size_t i = 0; i < cells; ++i) {
    if (count[i] == 0.0F) continue;
    map.rise_m.z[i] = sum_m[i] / count[i];
    map.missing[i] = 0;
  }
  return map;
}

}  // namespace plumb
