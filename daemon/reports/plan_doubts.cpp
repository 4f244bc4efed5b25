// SPDX-License-Identifier: Apache-2.0
#include "daemon/reports/plan_doubts.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "algo/comparison/body_parts.hpp"
#include "algo/motion/region.hpp"

namespace plumb {

bool ContradictsPosture(const Scene& scene, const Pose& T_iec_scene, PatientPosture posture) {
  if (!scene.height_map) return false;
  const std::vector<std::uint8_t> body = ReferenceRegion(scene, {});
  const BodyParts parts = DescribeBody({.reference = *scene.height_map,
                                        .deviation_after = *scene.height_map,
                                        .region_mask = body,
                                        .body_mask = body,
                                        .T_iec_reference = T_iec_scene,
                                        .posture = posture});
  // No patient lies across a CT, but a CT of one region is often wider than it is long.
  return scene.planning ? parts.head_at_other_end : !parts.by_posture;
}

double IsocentreAway_m(const Scene& scene, const std::array<double, 3>& isocentre_m) {
  if (!scene.height_map) return 0.0;
  const auto& [x, y, z] = isocentre_m;
  const GridShape& grid = scene.height_map->grid;
  double nearest_m = std::numeric_limits<double>::infinity();
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      const float height_m = scene.height_map->at(row, column);
      if (std::isnan(height_m)) continue;
      nearest_m = std::min(
          nearest_m, std::hypot(grid.x_centre(column) - x, grid.y_centre(row) - y, height_m - z));
    }
  }
  return nearest_m;
}

}  // namespace plumb
