// SPDX-License-Identifier: Apache-2.0
// Monitoring over a recording, as `plumb monitor` and `plumb evaluate` do it.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "algo/types/frame.hpp"
#include "algo/types/scene.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/monitoring_files/monitoring_folder.hpp"

namespace plumb {

using Recordings = std::vector<std::unique_ptr<FrameSource>>;

/// Every frame of the recordings, in the order of their stamps: sensors on one clock.
/// @param name  Shown with the progress; may be empty.
/// @throws DataError from recording or scene, Interrupted on a stop request.
[[nodiscard]] MonitoringRecord WatchRecordings(const Recordings& recordings, const Scene& scene,
                                               const MonitorOptions& options,
                                               const std::string& name, Progress& progress,
                                               const CommandContext& context);

}  // namespace plumb
