// SPDX-License-Identifier: Apache-2.0
// A calibration's correction of depth, evaluated over an image.
#pragma once

#include <cstddef>
#include <vector>

#include "algo/sensor_calibration/calibration_model.hpp"

namespace plumb {

/// z' = z (1 + scale + slope_x x + slope_y y + field(x, y) + growth(x, y) FieldGrowth(z)) + offset
/// + bow (x^2 + y^2), with x, y the CentredCoordinates() of a cell's centre. Cells are windows of
/// `window_px` pixels, row-major; 1 for the image itself. Immutable; threads may share it.
class DepthCorrection {
 public:
  DepthCorrection(const CalibrationModel& calibration, int image_width, int image_height,
                  int window_px);
  [[nodiscard]] double Correct(std::size_t cell, double z_m) const {
    const Cell& c = cells_[cell];
    return z_m * (1.0 + c.factor + c.growth * FieldGrowth(z_m)) + c.offset_m;
  }
  /// Derivative of Correct() with the depth: what becomes of a small error of the measurement.
  [[nodiscard]] double Slope(std::size_t cell, double z_m) const {
    const Cell& c = cells_[cell];
    return 1.0 + c.factor + c.growth * (FieldGrowth(z_m) + z_m * FieldGrowthSlope(z_m));
  }

 private:
  struct Cell {
    double factor = 0;
    double growth = 0;
    double offset_m = 0;
  };
  std::vector<Cell> cells_;
};

/// FieldProducts() of each cell's centre, in the order of DepthCorrection's cells.
[[nodiscard]] std::vector<FieldRow> FieldProductsOfCells(int image_width, int image_height,
                                                         int window_px);

}  // namespace plumb
