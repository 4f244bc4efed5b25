// SPDX-License-Identifier: Apache-2.0
// Medians and quantiles of measured values, defined once for all modules.
#pragma once

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <vector>

namespace plumb {

/// Standard deviations per median absolute deviation of normally distributed values.
inline constexpr double kMadToSigma = 1.4826;
/// Standard deviations on either side of the mean that hold 95 % of normally distributed values.
inline constexpr double kCover95 = 1.96;

/// The value of the given rank, counted from 0. Reorders the values.
/// @throws std::invalid_argument if there is no value of that rank.
template <typename T>
[[nodiscard]] T TakeRank(std::vector<T>& values, std::size_t rank) {
  if (rank >= values.size()) throw std::invalid_argument("no value of this rank");
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

/// The middle value, or the upper of the two middle values. Reorders the values.
/// @throws std::invalid_argument without values.
template <typename T>
[[nodiscard]] T TakeMedian(std::vector<T>& values) {
  return TakeRank(values, values.size() / 2);
}

/// The value of rank `fraction` * (number - 1), rounded down, so that the result is always one of
/// the values. Reorders the values.
/// @param fraction  0: the smallest, 1: the largest.
/// @throws std::invalid_argument without values, or for another fraction.
template <typename T>
[[nodiscard]] T TakeQuantile(std::vector<T>& values, double fraction) {
  if (values.empty() || !(fraction >= 0.0 && fraction <= 1.0))
    throw std::invalid_argument("a quantile needs values and a fraction from 0 to 1");
  return TakeRank(values,
                  static_cast<std::size_t>(fraction * static_cast<double>(values.size() - 1)));
}

}  // namespace plumb
