// What is wrong in the room of a suite: prints, markers that move, cables, hands, breath.
#pragma once

#include <cstdint>

#include "drivers/simulated/suite_plan.hpp"

namespace plumb::simulated {

/// Changes the planned room and scenes as the unit's faults say. Every fault has its own random
/// numbers. Boards and sweeps must be planned already; ScenePlan::boards is set here.
void ApplyRoomFaults(SuitePlan& plan, std::uint64_t seed);

}  // namespace plumb::simulated
