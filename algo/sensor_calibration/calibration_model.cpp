// SPDX-License-Identifier: Apache-2.0
#include "algo/sensor_calibration/calibration_model.hpp"

namespace plumb {

namespace {

// Decreases with the order, because the field is smooth.
constexpr double kFieldSigma = 0.006;
constexpr double kGrowthSigma = 0.002;  // Fraction of the depth, per metre.

std::array<double, CalibrationModel::kDepthSize> DepthSigmas() {
  std::array<double, CalibrationModel::kDepthSize> sigma = {0.01,  0.003, 0.004, 2.0, 2.0,
                                                            0.004, 0.003, 0.003, 0.02};
  for (std::size_t i = 0; i < kFieldOrders.size(); ++i)
    sigma[static_cast<std::size_t>(kDepthField) + i] =
        kFieldSigma / (kFieldOrders[i].x + kFieldOrders[i].y);
  for (std::size_t i = 0; i < kGrowthOrders.size(); ++i) sigma[kDepthGrowth + i] = kGrowthSigma;
  return sigma;
}

}  // namespace

const std::array<double, CalibrationModel::kDepthSize> CalibrationModel::kDepthSigma =
    DepthSigmas();

double CalibrationModel::CorrectedDepth(double z_m, const Eigen::Vector2d& centred) const {
  const FieldRow products = FieldProducts(centred);
  double factor = 1.0 + depth[kDepthScale] + depth[kDepthSlopeX] * centred.x() +
                  depth[kDepthSlopeY] * centred.y();
  for (int i = 0; i < kNumFieldTerms; ++i)
    factor += depth[static_cast<std::size_t>(kDepthField + i)] * products[i];
  for (int i = 0; i < kNumGrowthTerms; ++i)
    factor += depth[static_cast<std::size_t>(kDepthGrowth + i)] * products[kNumFieldTerms + i] *
              FieldGrowth(z_m);
  return z_m * factor + depth[kDepthOffset] + depth[kDepthBow] * centred.squaredNorm();
}

Intrinsics CalibrationModel::Corrected(const Intrinsics& stated) const {
  Intrinsics corrected = stated;
  const double scale = stated.width / 640.0;
  corrected.fx *= 1.0 + lens[0];
  corrected.fy *= 1.0 + lens[1];
  corrected.cx += lens[2] * scale;
  corrected.cy += lens[3] * scale;
  for (std::size_t i = 0; i < 4; ++i) corrected.distortion[i] += lens[4 + i];
  return corrected;
}

}  // namespace plumb
