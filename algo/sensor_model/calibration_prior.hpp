// A calibration as one vector, and its prior distribution before a sweep.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "algo/sensor_model/calibration_model.hpp"

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

  [[nodiscard]] double Cost(const CalibrationVector& x) const {
    return 0.5 * (x - mean).dot(information * (x - mean));
  }
};

/// Standard deviations of a calibration of which this is the information; none if it is singular.
[[nodiscard]] std::optional<CalibrationVector> SigmasOf(const CalibrationMatrix& information);

/// Prior of a unit of which only the stated calibration is known.
[[nodiscard]] CalibrationPrior PriorOfAnyUnit(
    double edge_bias_sigma_px = CalibrationModel::kEdgeBiasSigma);

}  // namespace plumb
