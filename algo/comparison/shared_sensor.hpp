// SPDX-License-Identifier: Apache-2.0
// Two sweeps by one sensor unit share its calibration: what each sweep estimated of it is joined.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "algo/comparison/scene_alignment.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

struct SharedSensorInput {
  const Scene& reference;
  const Scene& current;
  const Alignment& alignment;
  Pose T_motion = Pose::Identity();                      ///< p_current = T_motion * p_reference
  Eigen::Vector3d centroid_m = Eigen::Vector3d::Zero();  ///< Of the region, reference frame.
  /// Whether a point of the reference surface, in the reference frame, belongs to the region.
  std::function<bool(const Eigen::Vector3d&)> in_region;
};

/// Effect of the estimated calibrations on a body motion. Left perturbations (rotation vector,
/// translation) about the moved centroid, reference frame.
struct SharedSensor {
  bool one_unit = false;  ///< False: the scans may be by two units, and nothing was joined.
  Vector6d correction = Vector6d::Zero();  ///< Joining the two estimates moves the motion by it.
  Matrix6d covariance =
      Matrix6d::Zero();  ///< Of the motion, from the calibration's remaining uncertainty.
};

/// Each scene depends on its sweep's estimate of the sensor's calibration, and so does the position
/// of the body relative to the markers. If one unit made both scans, there is only one true
/// calibration, apart from DriftBetweenSweeps(): a Kalman update of both estimates by their
/// difference moves each scene by its own sensitivity. Scans by one unit have the same stated
/// calibration, not a nominal one, and estimates that agree (chi-square test at 1 in 1,000). Absent
/// where a scene has no sensitivity, or too little of the region or too few markers take part.
[[nodiscard]] std::optional<SharedSensor> JoinSensors(const SharedSensorInput& input);

/// Covariance of the motion from the calibration of the current scan alone, where the reference has
/// none: a planning CT shares no sensor, so nothing cancels out. Absent as above.
[[nodiscard]] std::optional<Matrix6d> SensorAlone(const SharedSensorInput& input);

/// The same from both calibrations, where the scans share no marker, so that nothing is joined.
/// @param reference_markers  The markers that place the reference; those of `input.alignment` place
///        the current scan.
[[nodiscard]] std::optional<Matrix6d> SensorsApart(const SharedSensorInput& input,
                                                   const std::vector<int>& reference_markers);

}  // namespace plumb
