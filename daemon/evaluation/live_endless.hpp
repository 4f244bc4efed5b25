// SPDX-License-Identifier: Apache-2.0
// Live monitoring for hours: rendered and judged on the fly, in parts that are kept, so that a run
// that was ended goes on.
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>

#include "algo/verdict/gates.hpp"
#include "drivers/simulator/suites/endless_live.hpp"

namespace plumb {

struct EndlessOptions {
  SimulateOptions simulate;  ///< Seed and unit of the first part; each has its own.
  simulated::EndlessKind kind = simulated::EndlessKind::kMoves;
  int parts = 1;
  double part_s = 600.0;
  double rate_hz = 10.0;  ///< Of the frames before the sensor at rest.
  AcceptanceLimits limits;
  /// Exists: KIND-SENSOR-SEED.json of each part; those there are not made again.
  std::filesystem::path out;
};

/// @param progress  Called with the part (from 1 on) and its fraction.
/// @return Figures of all parts of the kind in the folder, as a table.
/// @throws Interrupted between frames; what is finished stays.
[[nodiscard]] std::string RunEndless(
    const EndlessOptions& options, const std::stop_token& stop,
    const std::function<void(int part, double fraction)>& progress);

}  // namespace plumb
