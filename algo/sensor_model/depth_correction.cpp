#include "algo/sensor_model/depth_correction.hpp"

namespace plumb {
namespace {

using Terms = Eigen::Matrix<double, FieldRow::RowsAtCompileTime, 1>;

Eigen::Vector2d CellCentre(int column, int row, int width, int height, int window_px) {
  return CentredCoordinates((column + 0.5) * window_px - 0.5, (row + 0.5) * window_px - 0.5, width,
                            height);
}

}  // namespace

DepthCorrection::DepthCorrection(const CalibrationModel& calibration, int image_width,
                                 int image_height, int window_px)
    : width_(image_width / window_px), height_(image_height / window_px) {
  const auto& d = calibration.depth;
  const Eigen::Map<const Terms> terms(d.data() + kDepthField);
  cells_.reserve(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
  for (int r = 0; r < height_; ++r) {
    for (int c = 0; c < width_; ++c) {
      const Eigen::Vector2d centred = CellCentre(c, r, image_width, image_height, window_px);
      const Terms products = FieldProducts(centred).cast<double>();
      const double slopes = d[kDepthSlopeX] * centred.x() + d[kDepthSlopeY] * centred.y();
      const double field = products.head<kNumFieldTerms>().dot(terms.head<kNumFieldTerms>());
      cells_.push_back({d[kDepthScale] + slopes + field,
                        products.tail<kNumGrowthTerms>().dot(terms.tail<kNumGrowthTerms>()),
                        d[kDepthOffset] + d[kDepthBow] * centred.squaredNorm()});
    }
  }
}

std::vector<FieldRow> FieldProductsOfCells(int image_width, int image_height, int window_px) {
  std::vector<FieldRow> rows;
  for (int r = 0; r < image_height / window_px; ++r)
    for (int c = 0; c < image_width / window_px; ++c)
      rows.push_back(FieldProducts(CellCentre(c, r, image_width, image_height, window_px)));
  return rows;
}

}  // namespace plumb
