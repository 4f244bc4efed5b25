// SPDX-License-Identifier: Apache-2.0
// Faults in the room of a suite: prints, moved markers, cables, hands, breathing.
#pragma once

#include <cstdint>

#include "drivers/simulator/suites/planned_scenes.hpp"

namespace plumb::simulated {

/// Applies the unit's faults to the planned room and scenes. Every fault has its own random
/// numbers. Boards and sweeps must be planned already; ScenePlan::boards is set here.
void ApplyRoomFaults(SuitePlan& plan, std::uint64_t seed);

}  // namespace plumb::simulated
