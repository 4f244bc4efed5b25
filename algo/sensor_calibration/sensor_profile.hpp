// SPDX-License-Identifier: Apache-2.0
// The calibration of one sensor unit as learned from several sweeps, used as the prior of the next.
#pragma once

#include <string>

#include "algo/base/intrinsics.hpp"
#include "algo/sensor_calibration/calibration_prior.hpp"

namespace plumb {

/// A unit's calibration as a normal distribution. The lens and the distortion of the depth image
/// stay the same for months. The shift of marker edges depends on the light and is never included.
struct SensorProfile {
  std::string name;  ///< Name for reports.
  /// Intrinsics to which the corrections apply; a recording with others is from another unit.
  Intrinsics stated;
  int num_sweeps = 0;
  CalibrationVector mean = CalibrationVector::Zero();
  CalibrationMatrix covariance = CalibrationMatrix::Zero();
};

/// Factor by which the scatter of a sweep's solution exceeds what its residuals indicate, because
/// residuals share errors outside the model. Measured on three sweeps of one simulated unit with
/// known truth: with it all lens terms are within 1.5 standard deviations.
inline constexpr double kSharedErrors = 3.0;

/// Standard deviations of the changes between consecutive sweeps of one unit.
[[nodiscard]] CalibrationVector DriftBetweenSweeps();

/// State before the first sweep.
[[nodiscard]] SensorProfile ProfileOfAnyUnit(const Intrinsics& stated,
                                             const UnitKnowledge& unit = {});

/// Prior for the next sweep: the profile's covariance plus the variation from sweep to sweep,
/// mostly thermal.
/// @throws DataError if the profile belongs to a sensor with other stated intrinsics, or its
///         covariance is not positive definite.
[[nodiscard]] CalibrationPrior PriorOfNextSweep(const SensorProfile& profile,
                                                const Intrinsics& stated,
                                                double edge_bias_sigma_px);

/// Result of one sweep: the solution under a prior, and the information in the sweep's own
/// residuals.
struct SweepEvidence {
  CalibrationVector solution = CalibrationVector::Zero();
  CalibrationMatrix information = CalibrationMatrix::Zero();
};

/// The profile after a sweep that was solved under `prior`, as returned by PriorOfNextSweep().
[[nodiscard]] SensorProfile Learn(const SensorProfile& profile, const CalibrationPrior& prior,
                                  const SweepEvidence& evidence);

}  // namespace plumb
