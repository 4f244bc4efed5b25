// SPDX-License-Identifier: Apache-2.0
// The height map: z above the reference marker's plane on a regular grid.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

namespace plumb {

/// Half-open cells: column c, row r covers x in [x_min + c step, x_min + (c+1) step), y likewise;
/// row 0 is y_min.
struct GridShape {
  double x_min = 0.0;  ///< Metres.
  double y_min = 0.0;
  double step = 0.0015;
  int width = 0;   ///< Columns (x).
  int height = 0;  ///< Rows (y).

  bool operator==(const GridShape&) const = default;
  [[nodiscard]] std::size_t num_cells() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  [[nodiscard]] double x_centre(int column) const { return x_min + (column + 0.5) * step; }
  [[nodiscard]] double y_centre(int row) const { return y_min + (row + 0.5) * step; }

  /// Index of the cell that contains (x, y), row-major; nothing outside the grid. All of Plumb uses
  /// this function.
  [[nodiscard]] std::optional<std::size_t> cell(double x, double y) const {
    const double column = std::floor((x - x_min) / step);
    const double row = std::floor((y - y_min) / step);
    if (!(column >= 0 && column < width && row >= 0 && row < height)) return std::nullopt;
    return index(static_cast<int>(row), static_cast<int>(column));
  }
  [[nodiscard]] bool contains(int row, int column) const {
    return row >= 0 && row < height && column >= 0 && column < width;
  }
  /// Index of a cell of the grid, row-major.
  [[nodiscard]] std::size_t index(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(column);
  }
};

/// Values on a grid, row-major, row 0 at y_min; NaN where unknown.
struct HeightMap {
  GridShape grid;
  std::vector<float> z;  ///< Metres; grid.num_cells() values.

  explicit HeightMap(const GridShape& shape = {})
      : grid(shape), z(shape.num_cells(), std::numeric_limits<float>::quiet_NaN()) {}
  [[nodiscard]] float at(int row, int column) const { return z[grid.index(row, column)]; }
  [[nodiscard]] float& at(int row, int column) { return z[grid.index(row, column)]; }
};

}  // namespace plumb
