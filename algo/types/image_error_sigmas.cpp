// SPDX-License-Identifier: Apache-2.0
#include "algo/types/image_error_sigmas.hpp"

#include <array>

namespace plumb {
namespace {

// A time-of-flight camera's cyclic error of some millimetres, light that walls reflect, and warmth
// change from image to image. A phone's plane of a flat door wobbled by 13 mm and 0.9 deg below its
// range.
constexpr std::array<ImageErrorSigmas, 4> kImageErrors = {{
    {},
    {},
    {.offset_m = 0.003, .tilt = 0.004},
    {.offset_m = 0.008, .tilt = 0.008},
}};

}  // namespace

const ImageErrorSigmas& ImageErrorSigmasOf(DepthSensor sensor) {
  return kImageErrors.at(static_cast<std::size_t>(sensor));
}

}  // namespace plumb
