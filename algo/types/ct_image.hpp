// SPDX-License-Identifier: Apache-2.0
// One image of a CT, as its file states it. Lengths in millimetres in the axes of the CT (LPS).
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "algo/types/treatment_plan.hpp"

namespace plumb {

struct CtImage {
  PlanningFile file;
  std::string series_uid;
  std::string position;  ///< Such as "HFS"; empty where it is not stated.
  int rows = 0, columns = 0;
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();  ///< Centre of the first pixel.
  /// Directions in which the columns of a row, and the rows, follow each other.
  Eigen::Vector3d along_row = Eigen::Vector3d::UnitX(), along_column = Eigen::Vector3d::UnitY();
  double column_spacing_mm = 0.0, row_spacing_mm = 0.0;  ///< From column to column, row to row.
  /// Row by row.
  std::vector<float> hu;
};

inline constexpr double kAir_hu = -1000.0;
/// Pixels without a measurement, such as those outside a round field of view, have kNothing_hu. No
/// measured pixel at the edge of an image is below kLeastMeasured_hu: it would be darker than air.
inline constexpr double kNothing_hu = -3000.0, kLeastMeasured_hu = -1500.0;

}  // namespace plumb
