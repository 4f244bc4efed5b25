// SPDX-License-Identifier: Apache-2.0
// Depth quantisation of a PS1080 sensor (Xtion Pro Live).
#pragma once

namespace plumb {

/// Reported depth for a true depth: the disparity code S is an integer (1/8 pixel), and z_mm =
/// trunc(9000 / (7.5 - 0.1042 ((S - 800) / 4 - 0.375))). The step is 1.4 mm at 0.7 m and 2.9 mm at
/// 1.0 m.
/// @param depth_mm  > 0; the nearest code is used.
[[nodiscard]] int QuantisePs1080(double depth_mm);

/// Depth of one disparity code, millimetres, truncated as in the driver.
[[nodiscard]] int Ps1080DepthOfCode(int code);

}  // namespace plumb
