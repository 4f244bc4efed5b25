// What several sweeps have taught about one sensor unit, for the next sweep to begin from.
#pragma once

#include <string>

#include "algo/base/intrinsics.hpp"
#include "algo/sensor_model/calibration_prior.hpp"

namespace plumb {

/// A unit's calibration as a normal distribution. Units keep their lens and their depth image's
/// distortion for months; the shift of marker edges belongs to the light and is never part of it.
struct SensorProfile {
  std::string name;  ///< For reports.
  Intrinsics
      stated;  ///< Which the corrections add to; a recording with other ones is another unit.
  int num_sweeps = 0;
  CalibrationVector mean = CalibrationVector::Zero();
  CalibrationMatrix covariance = CalibrationMatrix::Zero();
};

/// Before the first sweep.
[[nodiscard]] SensorProfile ProfileOfAnyUnit(const Intrinsics& stated);

/// What the profile says of the next sweep: its covariance and what changes from sweep to sweep,
/// mostly with warmth.
/// @throws DataError if the profile is of a sensor with other stated intrinsics, or its covariance
/// is none.
[[nodiscard]] CalibrationPrior PriorOfNextSweep(const SensorProfile& profile,
                                                const Intrinsics& stated,
                                                double edge_bias_sigma_px);

/// What one sweep showed: the solution under a prior, and the information that the sweep's own
/// residuals hold of each term.
struct SweepEvidence {
  CalibrationVector solution = CalibrationVector::Zero();
  CalibrationMatrix information = CalibrationMatrix::Zero();
};

/// The profile after a sweep that was solved under `prior`, which PriorOfNextSweep() made of it.
[[nodiscard]] SensorProfile Learn(const SensorProfile& profile, const CalibrationPrior& prior,
                                  const SweepEvidence& evidence);

}  // namespace plumb
