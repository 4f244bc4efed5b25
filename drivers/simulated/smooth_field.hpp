// A smooth random function over an image that no polynomial of low order follows.
#pragma once

#include <cstdint>
#include <vector>

namespace plumb::simulated {

/// Sum of 24 Gaussian bumps of random place, width (0.08 to 0.35 of the image's width, log-uniform,
/// unequal along and across) and sign; then mean 0 and RMS 1 over the image. Row-major.
/// The same shape at every image size. Pure.
[[nodiscard]] std::vector<float> SmoothField(std::uint64_t seed, int width, int height);

}  // namespace plumb::simulated
