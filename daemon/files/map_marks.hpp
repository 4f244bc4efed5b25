// SPDX-License-Identifier: Apache-2.0
// The marks at the edges of drawn maps: what lies in which direction.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "algo/comparison/body_parts.hpp"
#include "algo/comparison/comparison.hpp"
#include "algo/comparison/correction.hpp"
#include "algo/render/picture_words.hpp"

namespace plumb {

/// Texts of the marks.
struct SideWords {
  std::string_view head = "HEAD", feet = "FEET", left = "LEFT", right = "RIGHT", gantry = "GANTRY";
};

/// The gantry and the patient's sides, each only if it is known; without the patient's sides, the
/// room's axes to either side of the gantry. The gantry comes first, so that it is drawn outermost.
[[nodiscard]] std::vector<MapMark> MapMarks(const std::optional<PatientAxes>& patient,
                                            const std::optional<RoomWays>& room,
                                            const SideWords& words = {});

/// The marks of a comparison: the patient's sides only where the body was found to lie as planned
/// and there is an answer.
[[nodiscard]] std::vector<MapMark> MapMarks(const Comparison& comparison);

}  // namespace plumb
