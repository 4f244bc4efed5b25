// SPDX-License-Identifier: Apache-2.0
// Computes the positions of a marker's corners from the depth image.
#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "algo/geometry/back_projection.hpp"
#include "algo/types/keyframe.hpp"
#include "algo/types/marker.hpp"

namespace plumb {

/// Side of the paper's window s for an image of this width: 11 px at 640 columns, odd, at least 3.
/// @throws std::invalid_argument if window_px_at_640 or image_width is not positive.
[[nodiscard]] int DepthWindow(int window_px_at_640, int image_width);

/// Corners in the camera frame as published (paper, Eq. markercornerposition): the depth at the
/// corner's pixel, otherwise the mean of the back-projected valid pixels of the window around it.
/// Nothing where the window is empty or the corner is outside the image. The mean moves x and y
/// towards the side that has depth (5-7 mm at a gap): for preset `paper` only.
/// @param rays  Of the view's camera.
/// @throws std::invalid_argument if depth image and rays do not fit together.
[[nodiscard]] std::array<std::optional<Eigen::Vector3d>, 4> PaperCornerPositions(
    const MarkerObservation& marker, const DepthView& view, const RayTable& rays,
    int window_px_at_640 = 11);

}  // namespace plumb
