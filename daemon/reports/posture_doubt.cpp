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
  const BodyParts parts = DescribeBody({.reference = *scene.height_map,
                                        .deviation_after = *scene.height_map,
                                        .region_mask = body,
                                        .body_mask = body,
                                        .T_iec_reference = T_iec_scene,
                                        .posture = posture});
  // Nobody lies across in a CT, but one of a region is often wider than it is long.
  return scene.planning ? parts.head_at_other_end : !parts.by_posture;
}

}  // namespace plumb
