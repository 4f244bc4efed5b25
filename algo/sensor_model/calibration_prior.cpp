#include "algo/sensor_model/calibration_prior.hpp"

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
