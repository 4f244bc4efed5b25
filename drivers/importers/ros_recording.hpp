// SPDX-License-Identifier: Apache-2.0
// What ROS records of a depth camera's driver, and recordings of realsense-viewer and
// librealsense2, which are ROS 1 bags with topics of their own.
#pragma once

#include <memory>

#include "drivers/importers/recorded_file.hpp"
#include "drivers/importers/ros_messages.hpp"

namespace plumb {

/// The first depth and the first colour stream: intrinsics, the pose of the depth camera (depth is
/// registered only where a ROS driver has aligned it), the unit of the depth, the sensor's name,
/// serial and firmware. Stamps are mid-exposure where the metadata have them. What is missing is in
/// the warnings.
/// @throws DataError for a damaged file, one without depth or colour, a lens model that Plumb does
///         not know, and kinds of images that it does not read.
[[nodiscard]] std::unique_ptr<RecordedFile> OpenRosRecording(std::unique_ptr<RosMessages> messages);

}  // namespace plumb
