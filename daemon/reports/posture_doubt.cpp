// SPDX-License-Identifier: Apache-2.0
#include "daemon/reports/posture_doubt.hpp"

#include <cstdint>
#include <vector>

#include "algo/comparison/body_parts.hpp"
#include "algo/motion/region.hpp"

namespace plumb {

bool ContradictsPosture(const Scene& scene, const Pose& T_iec_scene, PatientPosture posture) {
  if (!scene.height_map) return false;
  const std::vector<std::uint8_t> body = ReferenceRegion(scene, {});
  return !DescribeBody({.reference = *scene.height_map,
                        .deviation_after = *scene.height_map,
                        .region_mask = body,
                        .body_mask = body,
                        .T_iec_reference = T_iec_scene,
                        .posture = posture})
              .by_posture;
}

}  // namespace plumb
