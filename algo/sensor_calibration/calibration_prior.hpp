// SPDX-License-Identifier: Apache-2.0
// A calibration as one vector, and its prior distribution before a sweep.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "algo/sensor_calibration/calibration_model.hpp"
#include "algo/sensor_model/depth_sensor.hpp"

namespace plumb {

/// Positions of CalibrationModel's blocks in the vector.
inline constexpr int kLensAt = 0;
inline constexpr int kReadoutAt = kLensAt + CalibrationModel::kLensSize;
inline constexpr int kEdgeBiasAt = kReadoutAt + 1;
inline constexpr int kDepthAt = kEdgeBiasAt + 1;
inline constexpr int kCalibrationSize = kDepthAt + CalibrationModel::kDepthSize;
using CalibrationVector = Eigen::Matrix<double, kCalibrationSize, 1>;
using CalibrationMatrix = Eigen::Matrix<double, kCalibrationSize, kCalibrationSize>;

[[nodiscard]] CalibrationVector ToVector(const CalibrationModel& calibration);
void MoveCalibration(const CalibrationVector& by, CalibrationModel& calibration);

/// Names of the vector's elements, with their units, as in CalibrationModel::Named() and
/// scene.json.
[[nodiscard]] const std::vector<std::string>& CalibrationNames();

/// Normal distribution of a sensor's calibration; adds 1/2 (x - mean)' information (x - mean) to a
/// least-squares problem.
struct CalibrationPrior {
  CalibrationVector mean = CalibrationVector::Zero();
  CalibrationMatrix information = CalibrationMatrix::Zero();
  int num_terms = kCalibrationSize;  ///< Those that the sensor's class has.

  [[nodiscard]] double Cost(const CalibrationVector& x) const {
    return 0.5 * (x - mean).dot(information * (x - mean));
  }
};

/// Standard deviations of a calibration of which this is the information; none if it is singular.
[[nodiscard]] std::optional<CalibrationVector> SigmasOf(const CalibrationMatrix& information);

/// What is known of a unit before its first sweep.
struct UnitKnowledge {
  DepthSensor sensor = DepthSensor::kStructuredLight;
  /// All of the lens's distortion is stated as 0, which a maker does who has not measured it.
  bool lens_stated_straight = false;
  /// The two images of each pair bear one stamp, so that up to half a period may lie between them.
  bool one_stamp = false;
};

/// Prior of a unit of which only its class and the stated calibration are known. A constant shift
/// of the disparity changes depth by its square, that is kDepthScale and the constant growth
/// together (as far as FieldGrowth() reaches), so the two are correlated where the class has one;
/// so are the slopes and the linear growth for a shift that changes over the image.
[[nodiscard]] CalibrationPrior PriorOfAnyUnit(
    double edge_bias_sigma_px = CalibrationModel::kEdgeBiasSigma, const UnitKnowledge& unit = {});

}  // namespace plumb
