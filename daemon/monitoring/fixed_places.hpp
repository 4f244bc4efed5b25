// SPDX-License-Identifier: Apache-2.0
// Where units that are fixed in the room for good stand.
#pragma once

#include <filesystem>
#include <string>

#include "algo/base/message.hpp"
#include "algo/base/pose.hpp"

namespace plumb {

/// The place of a unit is learned when it is first seen mounted, and compared each time after.
/// @param file   The places learned, by serial (JSON); written where this unit has none yet.
/// @param T_room_camera  By the room's markers; room: IEC fixed frame.
/// @return What a person should know: that it was learned, that the unit stands elsewhere, or that
///         the file cannot be used, which is then left as it is. Empty if it stands where it did.
[[nodiscard]] Message CheckFixedPlace(const std::filesystem::path& file, const std::string& serial,
                                      const Pose& T_room_camera);

}  // namespace plumb
