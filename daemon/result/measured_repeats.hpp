// SPDX-License-Identifier: Apache-2.0
// Sweeps of a thing that did not move, all compared with each other, and what that shows.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "algo/comparison/comparison.hpp"
#include "algo/types/scene.hpp"
#include "algo/verdict/repeatability.hpp"

namespace plumb {

struct MeasuredRepeats {
  std::vector<RepeatedSweep> sweeps;
  std::vector<RepeatedPair> pairs;
  Repeatability judged;
};

/// @param names  Of the sweeps, one for each scene.
/// @throws as Compare()
[[nodiscard]] MeasuredRepeats MeasureRepeats(const std::vector<Scene>& scenes,
                                             const std::vector<std::string>& names,
                                             const CompareOptions& options);

/// As `plumb repeat --json` writes it.
[[nodiscard]] nlohmann::ordered_json RepeatsJson(const MeasuredRepeats& repeats);

}  // namespace plumb
