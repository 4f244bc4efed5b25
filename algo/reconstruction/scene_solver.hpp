// SPDX-License-Identifier: Apache-2.0
// Makes the scene of a sweep that was tracked: joint solve, surface, breathing, height map.
#pragma once

#include <cstdint>
#include <functional>
#include <stop_token>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/diagnosis/sweep_watch.hpp"
#include "algo/map/map.hpp"
#include "algo/reconstruction/reconstructor_options.hpp"
#include "algo/tracking/tracker.hpp"
#include "algo/types/frame.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// All that tracking has left of a sweep. Copies share the images.
struct TrackedSweep {
  StreamInfo info;
  ReconstructorOptions options;
  std::vector<TrackedFrame> frames;
  TrackingMap map;
  SweepWatch watch;
  std::int64_t num_dropped = 0;
  std::vector<double> median_depths_m;  ///< One per frame that has valid depth.
  std::vector<double> tracking_times_s;
};

/// @param progress  May be empty.
/// @throws what Reconstructor::Finish() does.
[[nodiscard]] Scene SolveScene(TrackedSweep sweep, const std::stop_token& stop,
                               const std::function<void(double, const Message&)>& progress);

}  // namespace plumb
