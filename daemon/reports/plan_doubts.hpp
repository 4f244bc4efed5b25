// SPDX-License-Identifier: Apache-2.0
// What of a plan the scanned surface speaks against.
#pragma once

#include <array>

#include "algo/base/pose.hpp"
#include "algo/base/posture.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// Whether the surface speaks against posture and room: the body lies across the axis that they
/// state, or shows its head at the other end only. False for a scene without a height map.
[[nodiscard]] bool ContradictsPosture(const Scene& scene, const Pose& T_iec_scene,
                                      PatientPosture posture);

/// How far an isocentre (scene frame, metres) is from the nearest of the scanned surface; 0 for a
/// scene without a height map.
[[nodiscard]] double IsocentreAway_m(const Scene& scene, const std::array<double, 3>& isocentre_m);

}  // namespace plumb
