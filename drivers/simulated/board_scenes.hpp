// Scenes in which the board of the room's calibration lies where the body lies else.
#pragma once

#include <map>

#include <Eigen/Core>

#include "drivers/simulated/suite_plan.hpp"

namespace plumb::simulated {

/// The board's frame, which is the room's: its cross at the simulated lasers. Turned a little
/// against the sweep, so that a calibrated room is told from one that was assumed.
[[nodiscard]] Pose CalibrationBoardPose();

/// Puts `num_scenes` scenes without a body before those of the plan: the plan's room and first
/// sweep, each with noise and tremor of its own, and the board's markers on the support. Markers of
/// the room that would lie under it, or have an id of its, are put away in them.
/// @param centres_m  Of the board's markers on the sheet, by id.
/// @throws std::invalid_argument if the reference marker would have to be put away.
void AddBoardScenes(SuitePlan& plan, const std::map<int, Eigen::Vector2d>& centres_m,
                    int num_scenes);

}  // namespace plumb::simulated
