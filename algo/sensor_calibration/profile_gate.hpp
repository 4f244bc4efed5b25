// SPDX-License-Identifier: Apache-2.0
// Tests whether a sweep agrees with its sensor unit's profile, and ages the profile.
#pragma once

#include "algo/sensor_calibration/sensor_profile.hpp"

namespace plumb {

/// The profile after a number of days without a sweep: for each month its covariance grows by the
/// variation between sweeps. A negative age counts as zero.
[[nodiscard]] SensorProfile Aged(const SensorProfile& profile, double days);

/// Chi-square test of a sweep against the profile from which it started.
struct ProfileAgreement {
  double chi_square = 0.0;  ///< Over the terms about which the sweep carries information.
  int num_terms = 0;        ///< Number of those terms.
  double limit = 0.0;       ///< Exceeded by one in 1000 sweeps of the same unit.

  [[nodiscard]] bool agrees() const { return chi_square <= limit; }
};

/// @param before  The profile from which the sweep started.
/// @param after   The result of Learn(). If the unit is the same and unchanged, the change of the
///         mean has the covariance that the sweep removed. The shift of marker edges is excluded,
///         because it depends on the light.
/// @throws DataError if `before` does not have a positive definite covariance.
[[nodiscard]] ProfileAgreement Agreement(const SensorProfile& before, const SensorProfile& after);

/// The value that a chi-square variable with the given degrees of freedom exceeds once in a
/// thousand. Wilson and Hilferty's approximation, at most 3.1 % too large.
[[nodiscard]] double ChiSquareLimit(int degrees_of_freedom);

}  // namespace plumb
