// SPDX-License-Identifier: Apache-2.0
// The direction of each of the six numbers in words, such as "toward gantry".
#pragma once

#include <array>
#include <optional>

#include "algo/base/message.hpp"
#include "algo/base/pose.hpp"
#include "algo/base/posture.hpp"
#include "algo/comparison/couch_numbers.hpp"

namespace plumb {

/// In a room whose orientation is known. Without a posture the words refer to the room alone.
/// @param couch  By couch::Component; in the order of the result: vertical, longitudinal, lateral,
///         pitch, roll, yaw. With couch-fixed markers the shifts have no words.
[[nodiscard]] std::array<Message, 6> WordsInRoom(const Vector6d& couch, MarkerKind kind,
                                                 std::optional<PatientPosture> posture);

/// Where the orientation of the room is unknown. They refer to the patient if the directions of
/// head and left are known, otherwise to the reference marker's axes, and never to couch or gantry.
[[nodiscard]] std::array<Message, 6> WordsWithoutRoom(const Vector6d& couch, MarkerKind kind,
                                                      const std::optional<PatientPosture>& posture,
                                                      const std::optional<PatientAxes>& patient);

}  // namespace plumb
