// SPDX-License-Identifier: Apache-2.0
// Other lens models than OpenCV's rational one, which Plumb computes with.
#pragma once

#include <array>
#include <optional>

#include "algo/base/intrinsics.hpp"

namespace plumb {

/// The rational lens that stands for an equidistant ("fisheye") one on a camera's whole image:
/// theta (1 + k1 theta² + k2 theta⁴ + k3 theta⁶ + k4 theta⁸) is the distorted radius of a ray at
/// the angle theta to the axis (Kannala and Brandt 2006; OpenCV's cv::fisheye).
/// @param camera  Its size, focal lengths and centre.
/// @return Nothing if the image sees farther than 75 deg from the axis, the lens cannot be undone
///         on it, or the two differ by more than 0.05 px somewhere.
[[nodiscard]] std::optional<std::array<double, 8>> RationalOfEquidistant(
    const std::array<double, 4>& coefficients, const Intrinsics& camera);

}  // namespace plumb
