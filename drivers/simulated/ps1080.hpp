// How a PS1080 sensor (Xtion Pro Live) quantises depth.
#pragma once

namespace plumb {

/// Depth that the sensor reports for a true depth: the disparity code S is an integer (1/8 pixel),
/// and z_mm = trunc(9000 / (7.5 - 0.1042 ((S - 800) / 4 - 0.375))). Step 1.4 mm at 0.7 m, 2.9 mm
/// at 1.0 m.
/// @param depth_mm  > 0; the nearest code is taken.
[[nodiscard]] int QuantisePs1080(double depth_mm);

/// Depth of one disparity code, millimetres, truncated as the driver does.
[[nodiscard]] int Ps1080DepthOfCode(int code);

}  // namespace plumb
