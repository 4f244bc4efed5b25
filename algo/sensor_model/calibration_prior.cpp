#include "algo/sensor_model/calibration_prior.hpp"

#include <fmt/format.h>
#include <Eigen/Cholesky>

namespace plumb {

CalibrationVector ToVector(const CalibrationModel& c) {
  CalibrationVector x;
  for (int i = 0; i < CalibrationModel::kLensSize; ++i)
    x[kLensAt + i] = c.lens[static_cast<std::size_t>(i)];
  x[kReadoutAt] = c.readout_s[0];
  x[kEdgeBiasAt] = c.edge_bias_px[0];
  for (int i = 0; i < CalibrationModel::kDepthSize; ++i)
    x[kDepthAt + i] = c.depth[static_cast<std::size_t>(i)];
  return x;
}

void MoveCalibration(const CalibrationVector& by, CalibrationModel& c) {
  for (int i = 0; i < CalibrationModel::kLensSize; ++i)
    c.lens[static_cast<std::size_t>(i)] += by[kLensAt + i];
  c.readout_s[0] += by[kReadoutAt];
  c.edge_bias_px[0] += by[kEdgeBiasAt];
  for (int i = 0; i < CalibrationModel::kDepthSize; ++i)
    c.depth[static_cast<std::size_t>(i)] += by[kDepthAt + i];
}

const std::vector<std::string>& CalibrationNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all = {
        "focal_x_scale",   "focal_y_scale",       "centre_x_px",      "centre_y_px",
        "distortion_k1",   "distortion_k2",       "distortion_p1",    "distortion_p2",
        "color_readout_s", "marker_edge_bias_px", "depth_scale",      "depth_offset_m",
        "depth_bow_m",     "depth_shift_x_px",    "depth_shift_y_px", "depth_delay_s",
        "depth_slope_x",   "depth_slope_y",       "depth_readout_s"};
    for (const auto& [x, y] : kFieldOrders) all.push_back(fmt::format("depth_field_{}_{}", x, y));
    for (const auto& [x, y] : kGrowthOrders)
      all.push_back(fmt::format("depth_field_growth_per_m_{}_{}", x, y));
    return all;
  }();
  return names;
}

std::optional<CalibrationVector> SigmasOf(const CalibrationMatrix& information) {
  const Eigen::LLT<CalibrationMatrix> solver(information);
  if (solver.info() != Eigen::Success) return std::nullopt;
  const CalibrationVector variances =
      solver.solve(CalibrationMatrix(CalibrationMatrix::Identity())).diagonal();
  if (!variances.allFinite() || variances.minCoeff() <= 0) return std::nullopt;
  return CalibrationVector(variances.cwiseSqrt());
}

CalibrationPrior PriorOfAnyUnit(double edge_bias_sigma_px) {
  using C = CalibrationModel;
  CalibrationVector sigma;
  for (int i = 0; i < C::kLensSize; ++i)
    sigma[kLensAt + i] = C::kLensSigma[static_cast<std::size_t>(i)];
  sigma[kReadoutAt] = C::kReadoutSigma;
  sigma[kEdgeBiasAt] = edge_bias_sigma_px;
  for (int i = 0; i < C::kDepthSize; ++i)
    sigma[kDepthAt + i] = C::kDepthSigma[static_cast<std::size_t>(i)];
  CalibrationPrior prior;
  prior.information = sigma.cwiseAbs2().cwiseInverse().asDiagonal();
  return prior;
}

}  // namespace plumb
