// SPDX-License-Identifier: Apache-2.0
// Whether a reference lies as its plan states.
#pragma once

#include "algo/base/pose.hpp"
#include "algo/base/posture.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// Whether the surface speaks against posture and room: the body lies across the axis that they
/// state, or shows its head at the other end only. False for a scene without a height map.
[[nodiscard]] bool ContradictsPosture(const Scene& scene, const Pose& T_iec_scene,
                                      PatientPosture posture);

}  // namespace plumb
