// SPDX-License-Identifier: Apache-2.0
// The evaluation as a table for people and as JSON for programs.
#pragma once

#include <string>

#include "daemon/evaluation/evaluation.hpp"

namespace plumb {

/// Tables: motion errors by reference scene and in total beside the paper's, scenes, and times.
[[nodiscard]] std::string EvaluationTable(const Evaluation& evaluation);

/// {"format": 1, "suite", "preset", "by_reference": {NAME: {...}}, "total": {...}, "pairs": [...],
/// "scenes": {NAME: {...}}, "paper":
/// {...}}.
[[nodiscard]] std::string EvaluationJson(const Evaluation& evaluation);

}  // namespace plumb
