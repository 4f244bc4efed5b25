// SPDX-License-Identifier: Apache-2.0
#include "algo/sensor_calibration/depth_correction.hpp"

#include <tbb/parallel_for.h>

namespace plumb {
namespace {

using Terms = Eigen::Matrix<double, FieldRow::RowsAtCompileTime, 1>;

// Calls visit(cell, its centre in CentredCoordinates(), FieldProducts() there), rows in parallel.
template <typename Visit>
void ForEachCell(int image_width, int image_height, int window_px, const Visit& visit) {
  const int width = image_width / window_px;
  const int height = image_height / window_px;
  const auto centre = [&](int column, int row) {
    return CentredCoordinates((column + 0.5) * window_px - 0.5, (row + 0.5) * window_px - 0.5,
                              image_width, image_height);
  };
  std::vector<FieldAcross> across(static_cast<std::size_t>(width));
  for (int c = 0; c < width; ++c)
    across[static_cast<std::size_t>(c)] = PolynomialsAcross(centre(c, 0).x());
  tbb::parallel_for(0, height, [&](int r) {
    const FieldDown down = PolynomialsDown(centre(0, r).y());
    for (int c = 0; c < width; ++c)
      visit(static_cast<std::size_t>(r) * static_cast<std::size_t>(width) +
                static_cast<std::size_t>(c),
            centre(c, r), FieldProducts(across[static_cast<std::size_t>(c)], down));
  });
}

}  // namespace

DepthCorrection::DepthCorrection(const CalibrationModel& calibration, int image_width,
                                 int image_height, int window_px)
    : cells_(static_cast<std::size_t>(image_width / window_px) *
             static_cast<std::size_t>(image_height / window_px)) {
  const auto& d = calibration.depth;
  const Eigen::Map<const Terms> terms(d.data() + kDepthField);
  ForEachCell(image_width, image_height, window_px,
              [&](std::size_t i, const Eigen::Vector2d& centred, const FieldRow& row) {
                const Terms products = row.cast<double>();
                const double slopes = d[kDepthSlopeX] * centred.x() + d[kDepthSlopeY] * centred.y();
                const double field =
                    products.head<kNumFieldTerms>().dot(terms.head<kNumFieldTerms>());
                cells_[i] = {d[kDepthScale] + slopes + field,
                             products.tail<kNumGrowthTerms>().dot(terms.tail<kNumGrowthTerms>()),
                             d[kDepthOffset] + d[kDepthBow] * centred.squaredNorm()};
              });
}

std::vector<FieldRow> FieldProductsOfCells(int image_width, int image_height, int window_px) {
  std::vector<FieldRow> rows(static_cast<std::size_t>(image_width / window_px) *
                             static_cast<std::size_t>(image_height / window_px));
  ForEachCell(image_width, image_height, window_px,
              [&](std::size_t i, const Eigen::Vector2d&, const FieldRow& row) { rows[i] = row; });
  return rows;
}

}  // namespace plumb
