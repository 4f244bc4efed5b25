// Whether a sweep agrees with what is known of its sensor unit, and how that knowledge ages.
#pragma once

#include "algo/sensor_model/sensor_profile.hpp"

namespace plumb {

/// Standard deviations of what changes from one sweep to the next of the same unit.
[[nodiscard]] CalibrationVector DriftBetweenSweeps();

/// The profile after so many days without a sweep: its covariance grows by what changes from one
/// sweep to the next for each month that has passed. A negative age counts as none.
[[nodiscard]] SensorProfile Aged(const SensorProfile& profile, double days);

/// The chi-square test of what a sweep showed against the profile that it began from.
struct ProfileAgreement {
  double chi_square = 0.0;  ///< Of the terms that the sweep tells something about.
  int num_terms = 0;        ///< How many those are.
  double limit = 0.0;       ///< A sweep of the same unit stays below in 999 of 1000 cases.

  [[nodiscard]] bool agrees() const { return chi_square <= limit; }
};

/// @param before  What the sweep began from, and @param after what Learn() made of it. The move of
/// the mean has the covariance that the sweep took away, if it is the same unit and has not
/// changed. The shift of marker edges takes no part: it belongs to the light.
/// @throws DataError if `before` has no proper covariance.
[[nodiscard]] ProfileAgreement Agreement(const SensorProfile& before, const SensorProfile& after);

/// The value that a chi-square variable of so many degrees of freedom exceeds once in a thousand.
/// Wilson and Hilferty's approximation, at most 3.1 % above.
[[nodiscard]] double ChiSquareLimit(int degrees_of_freedom);

}  // namespace plumb
