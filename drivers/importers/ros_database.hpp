// SPDX-License-Identifier: Apache-2.0
// The messages of a ROS 2 bag in an SQLite database (.db3).
#pragma once

#include <memory>

#include "drivers/importers/recorded_file.hpp"
#include "drivers/importers/ros_messages.hpp"

namespace plumb {

/// @throws DataError for a damaged file and for a database of another program. A message that is
///         packed by itself (zstd) is unpacked.
[[nodiscard]] std::unique_ptr<RosMessages> OpenRosDatabase(FileBytes bytes);

}  // namespace plumb
