#include "algo/sensor_model/calibration_model.hpp"

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

std::map<std::string, double> CalibrationModel::Named() const {
  std::map<std::string, double> named = {{"focal_x_scale", 1.0 + lens[0]},
                                         {"focal_y_scale", 1.0 + lens[1]},
                                         {"centre_x_px", lens[2]},
                                         {"centre_y_px", lens[3]},
                                         {"distortion_k1", lens[4]},
                                         {"distortion_k2", lens[5]},
                                         {"distortion_p1", lens[6]},
                                         {"distortion_p2", lens[7]},
                                         {"color_readout_s", readout_s[0]},
                                         {"marker_edge_bias_px", edge_bias_px[0]},
                                         {"depth_scale", 1.0 + depth[kDepthScale]},
                                         {"depth_offset_m", depth[kDepthOffset]},
                                         {"depth_bow_m", depth[kDepthBow]},
                                         {"depth_shift_x_px", depth[kDepthShiftX]},
                                         {"depth_shift_y_px", depth[kDepthShiftY]},
                                         {"depth_delay_s", depth[kDepthDelay]},
                                         {"depth_slope_x", depth[kDepthSlopeX]},
                                         {"depth_slope_y", depth[kDepthSlopeY]},
                                         {"depth_readout_s", depth[kDepthReadout]}};
  for (std::size_t i = 0; i < kFieldOrders.size(); ++i)
    named["depth_field_" + std::to_string(kFieldOrders[i].x) + "_" +
          std::to_string(kFieldOrders[i].y)] = depth[kDepthField + i];
  for (std::size_t i = 0; i < kGrowthOrders.size(); ++i)
    named["depth_field_growth_per_m_" + std::to_string(kGrowthOrders[i].x) + "_" +
          std::to_string(kGrowthOrders[i].y)] = depth[kDepthGrowth + i];
  return named;
}

}  // namespace plumb
