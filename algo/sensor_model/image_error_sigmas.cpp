// SPDX-License-Identifier: Apache-2.0
#include "algo/sensor_model/image_error_sigmas.hpp"

#include <array>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

// Of a time-of-flight camera, light that walls reflect and warmth change from image to image, and
// the cyclic error of some millimetres follows the depth. With a curve of 1 mm instead of none,
// the motions of unit 81 are off by 0.16 instead of 0.29 deg (median), those of a unit without a
// cyclic error by 0.15 instead of 0.12; with 3 mm heights scatter by 1.2 mm instead of 0.9.
// Skin that seems deeper along each ray tilts a body by how it was looked at: 0.12 to 0.17 deg for
// two scans beyond what the other causes state (units 81 and 84); without skin, hardly any.
// With 3 mm for each image heights of unit 81 have a sigma of 1.2 mm and scatter by 0.9; with 2 mm,
// 1.0 mm both.
// A phone's plane of a flat door wobbled by 13 mm and 0.9 deg below its range. With 8 mm and 0.8 %
// heights of unit 82 have a sigma of 2.2 mm and scatter by 0.9; with these, 1.4 mm. Angles of two
// scans are off by 0.04 to 0.10 deg beyond what the other causes state (units 82 and 85).
// Surfaces of structured light turn with how the flanks were looked at: yaw of two scans scatters
// by 0.04 to 0.05 deg where the other causes state 0.03 (units 91, 92 and 93), so that 68, 72 and
// 84 % of its intervals held. The path is not turned there (0.01 deg), and active stereo shows none
// of it.
constexpr std::array<ImageErrorSigmas, 4> kImageErrors = {{
    {.body_turn_rad = 0.024 * kDegree},
    {},
    {.offset_m = 0.002,
     .tilt = 0.003,
     .curve_m = 0.001,
     .body_tilt_rad = 0.12 * kDegree,
     .body_turn_rad = 0.02 * kDegree},
    {.offset_m = 0.004,
     .tilt = 0.005,
     .body_tilt_rad = 0.06 * kDegree,
     .body_turn_rad = 0.06 * kDegree},
}};

}  // namespace

const ImageErrorSigmas& ImageErrorSigmasOf(DepthSensor sensor) {
  return kImageErrors.at(static_cast<std::size_t>(sensor));
}

}  // namespace plumb
