// SPDX-License-Identifier: Apache-2.0
#include "algo/sensor_calibration/calibration_prior.hpp"

#include <algorithm>
#include <cstddef>

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

// Here, because the model knows nothing of the vector and its names.
std::map<std::string, double> CalibrationModel::Named() const {
  const CalibrationVector values = ToVector(*this);
  std::map<std::string, double> named;
  for (int i = 0; i < kCalibrationSize; ++i) {
    const std::string& name = CalibrationNames()[static_cast<std::size_t>(i)];
    named[name] = values[i] + (name.ends_with("_scale") ? 1.0 : 0.0);
  }
  return named;
}

std::optional<CalibrationVector> SigmasOf(const CalibrationMatrix& information) {
  const Eigen::LLT<CalibrationMatrix> solver(information);
  if (solver.info() != Eigen::Success) return std::nullopt;
  const CalibrationVector variances =
      solver.solve(CalibrationMatrix(CalibrationMatrix::Identity())).diagonal();
  if (!variances.allFinite() || variances.minCoeff() <= 0) return std::nullopt;
  return CalibrationVector(variances.cwiseSqrt());
}

namespace {

// For a lens whose distortion was never measured. Sweeps and users' chessboards give k1 from 0.055
// to 0.109 and k2 from -0.2 to -0.08 for a RealSense D435.
constexpr double kUnmeasuredK1 = 0.1, kUnmeasuredK2 = 0.2;
// Half a period at 30 images a second.
constexpr double kOneStampDelay_s = 0.016;
// Factor that reduces the sigma of a term that the class does not have.
constexpr double kAbsent = 1e-3;
// The growth's vertical polynomial is 1 at 0.75 half widths from the centre.
constexpr double kDownToAcross = 0.75;

double& DepthTermOf(CalibrationVector& x, int term) { return x[kDepthAt + term]; }

// Index of the growth term with these orders.
int GrowthTerm(int x, int y) {
  const auto found = std::ranges::find_if(
      kGrowthOrders, [&](const FieldOrder& order) { return order.x == x && order.y == y; });
  return kDepthGrowth + static_cast<int>(found - kGrowthOrders.begin());
}

// The sigmas of structured light become those of the class.
void ApplyClass(const ClassSigmas& of_class, CalibrationVector& sigma) {
  const auto set = [&](int term, double value) {
    double& of_term = DepthTermOf(sigma, term);
    of_term = value > 0 ? value : kAbsent * of_term;
  };
  set(kDepthScale, of_class.scale);
  set(kDepthOffset, of_class.offset_m);
  set(kDepthBow, of_class.bow_m);
  set(kDepthShiftX, of_class.shift_px);
  set(kDepthShiftY, of_class.shift_px);
  set(kDepthDelay, of_class.delay_s);
  set(kDepthSlopeX, of_class.slope);
  set(kDepthSlopeY, of_class.slope);
  set(kDepthReadout, of_class.readout_s);
  for (int i = kDepthField; i < kNumDepthTerms; ++i)
    set(i, (i < kDepthGrowth ? of_class.field : of_class.growth) * DepthTermOf(sigma, i));
}

int NumAbsent(const ClassSigmas& of_class) {
  int count = 0;
  for (const double sigma : {of_class.scale, of_class.offset_m, of_class.bow_m, of_class.slope,
                             of_class.slope, of_class.readout_s})
    count += sigma > 0 ? 0 : 1;
  return count + (of_class.field > 0 ? 0 : kNumFieldTerms) +
         (of_class.growth > 0 ? 0 : kNumGrowthTerms);
}

}  // namespace

CalibrationPrior PriorOfAnyUnit(double edge_bias_sigma_px, const UnitKnowledge& unit) {
  using C = CalibrationModel;
  CalibrationVector sigma;
  for (int i = 0; i < C::kLensSize; ++i)
    sigma[kLensAt + i] = C::kLensSigma[static_cast<std::size_t>(i)];
  sigma[kReadoutAt] = C::kReadoutSigma;
  sigma[kEdgeBiasAt] = edge_bias_sigma_px;
  for (int i = 0; i < C::kDepthSize; ++i)
    sigma[kDepthAt + i] = C::kDepthSigma[static_cast<std::size_t>(i)];
  CalibrationPrior prior;
  if (unit.sensor == DepthSensor::kStructuredLight) {
    prior.information = sigma.cwiseAbs2().cwiseInverse().asDiagonal();
    return prior;
  }
  const ClassSigmas& of_class = ClassOf(unit.sensor).sigmas;
  ApplyClass(of_class, sigma);
  prior.num_terms -= NumAbsent(of_class);
  // A phone rectifies its colour images and makes each depth image for one of them: there neither a
  // straight lens nor a common stamp is for want of knowledge.
  const bool is_phone = unit.sensor == DepthSensor::kLidar;
  if (unit.lens_stated_straight && !is_phone) {
    sigma[kLensAt + 4] = kUnmeasuredK1;
    sigma[kLensAt + 5] = kUnmeasuredK2;
  }
  if (unit.one_stamp && !is_phone) DepthTermOf(sigma, kDepthDelay) = kOneStampDelay_s;
  CalibrationMatrix covariance = sigma.cwiseAbs2().asDiagonal();
  const auto couple = [&](double together, int term, int growth, double share) {
    CalibrationVector direction = CalibrationVector::Zero();
    DepthTermOf(direction, term) = together;
    DepthTermOf(direction, growth) = share * together;
    covariance += direction * direction.transpose();
  };
  couple(of_class.disparity_per_m, kDepthScale, GrowthTerm(0, 0), 1.0);
  couple(of_class.disparity_tilt_per_m, kDepthSlopeX, GrowthTerm(1, 0), 1.0);
  couple(of_class.disparity_tilt_per_m, kDepthSlopeY, GrowthTerm(0, 1), kDownToAcross);
  prior.information = covariance.llt().solve(CalibrationMatrix(CalibrationMatrix::Identity()));
  return prior;
}

}  // namespace plumb
