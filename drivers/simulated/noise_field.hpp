// Noise whose neighbouring pixels agree, as a sensor that matches windows of pixels makes it.
#pragma once

#include <cstdint>
#include <vector>

namespace plumb::simulated {

/// Standard deviation of the Gaussian filter after which white noise has lost 90 % of its
/// correlation at the given lag.
[[nodiscard]] double FilterSigmaOfLag(double lag_px);

/// Gaussian-filtered white noise of mean 0 and variance 1 at every pixel, row-major; the image
/// wraps around at its borders. Its correlation at a distance d is exp(-d^2 / (4 sigma_px^2)).
/// Parallel inside; a pure function of its arguments.
/// @param sigma_px  Of the filter; 0: white noise.
[[nodiscard]] std::vector<float> CorrelatedNoise(std::uint64_t seed, int width, int height,
                                                 double sigma_px);

}  // namespace plumb::simulated
