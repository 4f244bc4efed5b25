// SPDX-License-Identifier: Apache-2.0
// Plans the scenes of a suite: bodies, placements, room and sweeps, drawn from a seed.
#pragma once

#include <memory>

#include "drivers/simulator/sensor/simulated_source.hpp"
#include "drivers/simulator/suites/planned_scenes.hpp"
#include "drivers/simulator/suites/suite_options.hpp"

namespace plumb::simulated {

/// @throws std::invalid_argument for an unknown suite or numbers out of range.
[[nodiscard]] SuitePlan PlanSuite(const SimulateOptions& options);

/// The stream of one scene.
[[nodiscard]] std::unique_ptr<SimulatedSource> MakeSource(const SuitePlan& plan, std::size_t scene);

}  // namespace plumb::simulated
