// SPDX-License-Identifier: Apache-2.0
// Random subsampling with a minimum distance.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace plumb {

/// Poisson-disk subset of a cloud (paper: Subsample): points are visited in a random order and kept
/// if no kept point is nearer than `spacing`. Kept points are therefore at least `spacing` apart,
/// and every point of the cloud has a kept point nearer than that.
///
/// @param points  Finite coordinates, metres.
/// @param spacing  Metres; 0 keeps every point.
/// @return indices of the kept points, ascending.
/// @throws std::invalid_argument if spacing is negative or not finite, or a point is not finite or
///         is farther than a million spacings from the origin.
///
/// Thread-safe and deterministic: the order depends on `seed` alone, on every platform.
[[nodiscard]] std::vector<std::uint32_t> PoissonDiskSubset(std::span<const Eigen::Vector3f> points,
                                                           double spacing, unsigned seed);

}  // namespace plumb
