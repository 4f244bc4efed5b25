// SPDX-License-Identifier: Apache-2.0
// Random functions over an image: noise with correlated neighbouring pixels, as produced by a
// sensor that matches windows of pixels, and smooth ones.
#pragma once

#include <cstdint>
#include <vector>

namespace plumb::simulated {

/// Standard deviation of the Gaussian filter that reduces the correlation of white noise by 90 % at
/// the given lag.
[[nodiscard]] double FilterSigmaOfLag(double lag_px);

/// Gaussian-filtered white noise with mean 0 and variance 1 at every pixel, row-major; the image
/// wraps around at its borders. Its correlation at a distance d is exp(-d^2 / (4 sigma_px^2)).
/// Parallel inside; a pure function of its arguments.
/// @param sigma_px  Sigma of the filter; 0: white noise.
[[nodiscard]] std::vector<float> CorrelatedNoise(std::uint64_t seed, int width, int height,
                                                 double sigma_px);

/// A smooth function that low-order polynomials cannot represent: the sum of 24 Gaussian bumps of
/// random position, width (0.08 to 0.35 of the image's width, log-uniform, different along and
/// across) and sign, normalised to mean 0 and RMS 1 over the image. Row-major. The shape is the
/// same at every image size. Pure.
[[nodiscard]] std::vector<float> SmoothField(std::uint64_t seed, int width, int height);

}  // namespace plumb::simulated
