// SPDX-License-Identifier: Apache-2.0
// The numbers that form while one sweeps.
#pragma once

#include <optional>

#include <nlohmann/json.hpp>

#include "web/model/monitoring.hpp"

namespace plumb {

/// What a sweep says before its end. It is never stored and cannot be accepted.
struct FormingAnswer {
  double sweep_s = 0.0;                  ///< Time that the sweep had taken.
  std::optional<MotionNumbers> numbers;  ///< The correction; not set: there is no answer yet.
  double shift_tolerance_mm = 0.0, rotation_tolerance_deg = 0.0;
  bool is_enough = false;  ///< See FormingAnswerOf().
};

/// Null before there is one.
inline nlohmann::json FormingJson(const std::optional<FormingAnswer>& answer) {
  if (!answer) return nullptr;
  return {{"sweep_s", answer->sweep_s},
          {"numbers", MotionJson(answer->numbers)},
          {"shift_tolerance_mm", answer->shift_tolerance_mm},
          {"rotation_tolerance_deg", answer->rotation_tolerance_deg},
          {"is_enough", answer->is_enough}};
}

}  // namespace plumb
