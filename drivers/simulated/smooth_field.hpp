// A smooth random function over an image that low-order polynomials cannot represent.
#pragma once

#include <cstdint>
#include <vector>

namespace plumb::simulated {

/// Sum of 24 Gaussian bumps of random position, width (0.08 to 0.35 of the image's width,
/// log-uniform, different along and across) and sign, normalised to mean 0 and RMS 1 over the
/// image. Row-major. The shape is the same at every image size. Pure.
[[nodiscard]] std::vector<float> SmoothField(std::uint64_t seed, int width, int height);

}  // namespace plumb::simulated
