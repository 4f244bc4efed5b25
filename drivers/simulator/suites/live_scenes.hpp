// SPDX-License-Identifier: Apache-2.0
// Recordings of a sensor at rest over a body that breathes and moves.
#pragma once

#include <string>
#include <vector>

#include "drivers/simulator/suites/planned_scenes.hpp"
#include "drivers/simulator/suites/suite_options.hpp"

namespace plumb::simulated {

/// Names of the recordings, in order.
[[nodiscard]] const std::vector<std::string>& LiveNames();

/// Adds them after the plan's sweeps, over the body of the last one as it lies there: `live_still`
/// (only breathing), `live_steps` (the couch is moved under it in steps), `live_passing` (a gantry
/// passes, and the body moves behind it), `live_cough` (coughs, slides, a jerk), `live_pushed` (the
/// sensor is pushed by a millimetre), and `live_two_left` and `live_two_right`, two sensors that
/// see the same: an arm covers the left one, which is pushed later, while the body moves. Then
/// `live_dark` (the lights go off, and the body moves in the dark), `live_lossy` (frames are lost
/// and late), `live_sheet` (a sheet is put on the chest), `live_sway` (the mount sways by 0.2 mm,
/// twice a second), `live_pushed_2mm`, `live_pushed_5mm` and
/// `live_projector` (a second structured-light sensor shines on the same place, and the couch is
/// moved in steps).
void AddLiveScenes(SuitePlan& plan, const SimulateOptions& options);

/// Beside `rest` and `rest_moved`.
struct RestLoops {
  /// `rest_second` and `rest_second_moved`: at the same time, what another unit sees from the other
  /// side.
  bool with_second = false;
  /// `rest_step_1` to `rest_step_3`: the couch is brought to where the body of the first sweep lay;
  /// `rest_nudged`: there, after the sensor was nudged by 4 mm; `rest_held`: there, at the end of
  /// inspiration.
  bool with_steps = false;
};

/// Adds `rest`, one breath of four seconds before a sensor at rest over the body of a sweep, which
/// can be repeated for ever, and `rest_moved`, the same after the body was moved by 5 mm.
void AddRestLoops(SuitePlan& plan, const SimulateOptions& options, std::size_t sweep,
                  const RestLoops& wanted = {});

}  // namespace plumb::simulated
