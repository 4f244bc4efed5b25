#include "algo/tracking/bundle_model.hpp"

#include <cmath>

namespace plumb::bundle {
namespace {

// To second order: the twists stay small because each call linearises again.
Eigen::Matrix3d RightJacobian(const Eigen::Vector3d& w) {
  const Eigen::Matrix3d W = Skew(w);
  return Eigen::Matrix3d::Identity() - 0.5 * W + W * W / 6.0;
}

}  // namespace

Vector17d CalibrationVector(const CalibrationModel& c) {
  Vector17d x;
  for (int i = 0; i < 6; ++i) x[kLens + i] = c.lens[static_cast<std::size_t>(i)];
  x[kReadout] = c.readout_s[0];
  x[kEdgeBias] = c.edge_bias_px[0];
  for (int i = 0; i < CalibrationModel::kDepthSize; ++i)
    x[kDepth + i] = c.depth[static_cast<std::size_t>(i)];
  return x;
}

Vector17d PriorWeights() {
  using C = CalibrationModel;
  Vector17d w;
  for (int i = 0; i < 6; ++i) w[kLens + i] = 1.0 / C::kLensSigma[static_cast<std::size_t>(i)];
  w[kReadout] = 1.0 / C::kReadoutSigma;
  w[kEdgeBias] = 1.0 / C::kEdgeBiasSigma;
  for (int i = 0; i < C::kDepthSize; ++i)
    w[kDepth + i] = 1.0 / C::kDepthSigma[static_cast<std::size_t>(i)];
  return w;
}

void MoveCalibration(const Vector17d& by, CalibrationModel& c) {
  for (int i = 0; i < 6; ++i) c.lens[static_cast<std::size_t>(i)] += by[kLens + i];
  c.readout_s[0] += by[kReadout];
  c.edge_bias_px[0] += by[kEdgeBias];
  for (int i = 0; i < CalibrationModel::kDepthSize; ++i)
    c.depth[static_cast<std::size_t>(i)] += by[kDepth + i];
}

void CameraState::Prepare() {
  T_camera_world = PoseFromTwist(twist).inverse() * T_camera0_world;
  R_inverse = RotationFromVector(-twist.head<3>());
  J_right = RightJacobian(twist.head<3>());
}

SeenPoint See(const CameraState& camera, const Eigen::Vector3d& p_world, double dt_s) {
  const Eigen::Vector3d p = camera.T_camera_world * p_world;
  const auto w = camera.velocity_per_s.head<3>();
  SeenPoint seen;
  seen.J_time = -(w.cross(p) + camera.velocity_per_s.tail<3>());
  // Later camera, to first order: p - dt (w x p + v).
  seen.p = p + dt_s * seen.J_time;
  const Eigen::Matrix3d later = Eigen::Matrix3d::Identity() - dt_s * Skew(w);
  seen.J_pose.leftCols<3>() = later * Skew(p) * camera.J_right;
  seen.J_pose.rightCols<3>() = -later * camera.R_inverse;
  seen.J_world = later * camera.T_camera_world.linear();
  return seen;
}

SeenPixel ProjectCorrected(const Intrinsics& k, const std::array<double, 6>& lens,
                           const Eigen::Vector3d& p) {
  const double iz = 1.0 / p.z();
  const double x = p.x() * iz;
  const double y = p.y() * iz;
  const double r2 = x * x + y * y;
  const double k1 = k.distortion[0] + lens[4];
  const double k2 = k.distortion[1] + lens[5];
  const double p1 = k.distortion[2];
  const double p2 = k.distortion[3];
  const double k3 = k.distortion[4];
  const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3));  // d radial / dx = slope x
  const double xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
  const double yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
  const double fx = k.fx * (1.0 + lens[0]);
  const double fy = k.fy * (1.0 + lens[1]);
  const double scale = k.width / 640.0;
  SeenPixel seen;
  seen.pixel = {fx * xd + k.cx + lens[2] * scale, fy * yd + k.cy + lens[3] * scale};
  const double dxx = radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x;
  const double dxy = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
  const double dyy = radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x;
  seen.J_point << fx * dxx * iz, fx * dxy * iz, -fx * (dxx * x + dxy * y) * iz,  //
      fy * dxy * iz, fy * dyy * iz, -fy * (dxy * x + dyy * y) * iz;
  seen.J_lens << k.fx * xd, 0, scale, 0, fx * x * r2, fx * x * r2 * r2,  //
      0, k.fy * yd, 0, scale, fy * y * r2, fy * y * r2 * r2;
  return seen;
}

PredictedDepth PredictDepth(const CalibrationModel& calibration, const SeenPoint& seen,
                            const Eigen::Vector2d& centred, double row_share) {
  const auto& d = calibration.depth;
  const double bow = centred.squaredNorm();
  const double scale = 1.0 + d[0] + d[6] * centred.x() + d[7] * centred.y();
  PredictedDepth predicted;
  predicted.z_m = (seen.p.z() - d[1] - d[2] * bow) / scale;
  predicted.J_z = 1.0 / scale;
  const double late = seen.J_time.z() / scale;
  const double z = predicted.z_m / scale;
  predicted.J_depth << -z, -1.0 / scale, -bow / scale, 0, 0, late, -z * centred.x(),
      -z * centred.y(), late * row_share;
  return predicted;
}

double CauchyLoss(double squared, double scale) {
  return scale * scale * std::log1p(squared / (scale * scale));
}

}  // namespace plumb::bundle
