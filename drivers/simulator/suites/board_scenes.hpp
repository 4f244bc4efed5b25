// SPDX-License-Identifier: Apache-2.0
// Scenes with the room calibration board in place of the body.
#pragma once

#include <map>

#include <Eigen/Core>

#include "drivers/simulator/suites/suite_plan.hpp"

namespace plumb::simulated {

/// The board's frame, which is the room's: its cross is at the simulated lasers. It is slightly
/// rotated against the sweep, so that a calibrated room differs from an assumed one.
[[nodiscard]] Pose CalibrationBoardPose();

/// Inserts `num_scenes` scenes without a body before those of the plan: the plan's room and first
/// sweep, each with its own noise and tremor, and with the board's markers on the support. Markers
/// of the room that would lie under the board, or have one of its ids, are removed in these scenes.
/// @param centres_m  Centres of the board's markers on the sheet, by id.
/// @throws std::invalid_argument if the reference marker would have to be removed.
void AddBoardScenes(SuitePlan& plan, const std::map<int, Eigen::Vector2d>& centres_m,
                    int num_scenes);

}  // namespace plumb::simulated
