// SPDX-License-Identifier: Apache-2.0
// The couch in the contours that images of a CT give.
#pragma once

#include <optional>
#include <vector>

#include "algo/planning/contour_surface.hpp"

namespace plumb {

/// Height of a flat couch that reaches out beside the body on one side or both: what is outermost
/// is level and at one height along the scan, which no flank of a body is. Nothing where the body
/// hides the couch, where it is curved like a cradle, or where there is none.
/// @param slices  With points at most 6 mm apart. Several may lie at one place.
[[nodiscard]] std::optional<double> CouchTop(const std::vector<ContourSlice>& slices);

/// Height of a structure whose top is at one height along the scan; nothing for another one.
[[nodiscard]] std::optional<double> FlatTop(const std::vector<ContourSlice>& structure);

/// Draws everything up to a height flat, so that it has no inside: the couch is gone, and a body
/// that touches it ends there.
void RemoveBelow(double height_m, std::vector<ContourSlice>& slices);

}  // namespace plumb
