// Random subsampling with a minimum distance.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace plumb {

/// Poisson-disk subset of a cloud (paper: Subsample): points are visited in a random order and kept
/// if no kept point lies nearer than `spacing`. So kept points are at least `spacing` apart, and
/// every point of the cloud has a kept one nearer than that.
///
/// @param points  Finite coordinates, metres.
/// @param spacing  Metres; 0 keeps every point.
/// @return indices of the kept points, ascending.
/// @throws std::invalid_argument if spacing is negative or not finite, or a point is not finite or
/// lies further than a
///         million spacings from the origin.
///
/// Thread-safe and deterministic: the order comes from `seed` alone, on every platform.
[[nodiscard]] std::vector<std::uint32_t> PoissonDiskSubset(std::span<const Eigen::Vector3f> points,
                                                           double spacing, unsigned seed);

}  // namespace plumb
