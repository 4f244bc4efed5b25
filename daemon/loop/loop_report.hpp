// SPDX-License-Identifier: Apache-2.0
// The loop meter's results as text and for the status.
#pragma once

#include <cstdint>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "daemon/loop/loop_meter.hpp"

namespace plumb {

/// {"turns", "over_10_ms", "cpu_over_10_ms", "slow", "longest", "longest_cpu"}; the last two
/// {"what", "ms", "cpu_ms", "queued_ms", "blocked_ms"}, and `slow` {"times", "of"} by what was over
/// the limit by its own time. Null where nothing was measured.
[[nodiscard]] nlohmann::json LoopJson(const LoopMeter& meter);

/// A line for each source and part, the longest first.
[[nodiscard]] std::string LoopTable(const LoopMeter& meter);

/// One sentence for the log.
[[nodiscard]] std::string SlowTurnText(const LoopTurn& turn, std::int64_t unsaid);

}  // namespace plumb
