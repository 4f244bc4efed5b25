// SPDX-License-Identifier: Apache-2.0
#include "algo/bundle/bundle_model.hpp"

#include <algorithm>
#include <array>

namespace plumb::bundle {

Eigen::Matrix3d RightJacobian(const Eigen::Vector3d& w) {
  const Eigen::Matrix3d W = Skew(w);
  return Eigen::Matrix3d::Identity() - 0.5 * W + W * W / 6.0;
}

Eigen::Vector2d Inward(const ImageCorners& corners, std::size_t i) {
  const Eigen::Vector2d next = (corners[(i + 1) % 4] - corners[i]).normalized();
  const Eigen::Vector2d previous = (corners[(i + 3) % 4] - corners[i]).normalized();
  return next + previous;
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
  // The camera at a later time, to first order: p - dt (w x p + v).
  seen.p = p + dt_s * seen.J_time;
  const Eigen::Matrix3d later = Eigen::Matrix3d::Identity() - dt_s * Skew(w);
  seen.J_pose.leftCols<3>() = later * Skew(p) * camera.J_right;
  seen.J_pose.rightCols<3>() = -later * camera.R_inverse;
  seen.J_world = later * camera.T_camera_world.linear();
  return seen;
}

SeenPixel ProjectCorrected(const Intrinsics& k, const CalibrationModel::Lens& lens,
                           const Eigen::Vector3d& p) {
  const double iz = 1.0 / p.z();
  const double x = p.x() * iz;
  const double y = p.y() * iz;
  const double r2 = x * x + y * y;
  std::array<double, 8> distortion = k.distortion;
  for (std::size_t i = 0; i < 4; ++i) distortion[i] += lens[4 + i];
  const double p1 = distortion[2];
  const double p2 = distortion[3];
  const RadialFactor factor = RadialFactorAt(distortion, r2);
  const double radial = factor.value;
  const double slope = 2.0 * factor.slope;  // d radial / dx = slope x
  const double by_k1 = r2 / factor.denominator;
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
  seen.J_lens << k.fx * xd, 0, scale, 0, fx * x * by_k1, fx * x * by_k1 * r2, fx * 2.0 * x * y,
      fx * (r2 + 2.0 * x * x),  //
      0, k.fy * yd, 0, scale, fy * y * by_k1, fy * y * by_k1 * r2, fy * (r2 + 2.0 * y * y),
      fy * 2.0 * x * y;
  return seen;
}

DepthPlace::DepthPlace(const Eigen::Vector2d& pixel, const Intrinsics& stated)
    : centred(CentredCoordinates(pixel.x(), pixel.y(), stated.width, stated.height)),
      products(FieldProducts(centred)),
      row_fraction(ReadoutFraction(pixel, stated)) {}

namespace {

// Factor of a raw depth and its derivative with depth. Growth uses the true depth instead of the
// raw one; they differ by one percent of a term that is itself below one percent.
struct DepthFactor {
  DepthFactor(const CalibrationModel& calibration, double z_true_m, const DepthPlace& place) {
    const auto& d = calibration.depth;
    value = 1.0 + d[kDepthScale] + d[kDepthSlopeX] * place.centred.x() +
            d[kDepthSlopeY] * place.centred.y();
    for (int i = 0; i < kNumFieldTerms; ++i)
      value += d[static_cast<std::size_t>(kDepthField + i)] * place.products[i];
    for (int i = 0; i < kNumGrowthTerms; ++i)
      by_growth +=
          d[static_cast<std::size_t>(kDepthGrowth + i)] * place.products[kNumFieldTerms + i];
    value += by_growth * FieldGrowth(z_true_m);
    slope = by_growth * FieldGrowthSlope(z_true_m);
  }
  double value = 1;
  double by_growth = 0;
  double slope = 0;  // Per metre.
};

double RawDepth(const CalibrationModel& calibration, double z_true_m, const DepthPlace& place,
                double factor) {
  return (z_true_m - calibration.depth[kDepthOffset] -
          calibration.depth[kDepthBow] * place.centred.squaredNorm()) /
         factor;
}

}  // namespace

double PredictDepthOnly(const CalibrationModel& calibration, double z_true_m,
                        const DepthPlace& place) {
  return RawDepth(calibration, z_true_m, place, DepthFactor(calibration, z_true_m, place).value);
}

PredictedDepth PredictDepth(const CalibrationModel& calibration, const SeenPoint& seen,
                            const DepthPlace& place) {
  const DepthFactor of_depth(calibration, seen.p.z(), place);
  const double factor = of_depth.value;
  PredictedDepth predicted;
  predicted.z_m = RawDepth(calibration, seen.p.z(), place, factor);
  predicted.J_z = (1.0 - predicted.z_m * of_depth.slope) / factor;
  const double late = seen.J_time.z() * predicted.J_z;
  const double z = predicted.z_m / factor;
  DepthRow& J = predicted.J_depth;
  J[kDepthScale] = -z;
  J[kDepthOffset] = -1.0 / factor;
  J[kDepthBow] = -place.centred.squaredNorm() / factor;
  J[kDepthDelay] = late;
  J[kDepthSlopeX] = -z * place.centred.x();
  J[kDepthSlopeY] = -z * place.centred.y();
  J[kDepthReadout] = late * place.row_fraction;
  J.segment<kNumFieldTerms>(kDepthField) =
      -z * place.products.head<kNumFieldTerms>().cast<double>().transpose();
  J.segment<kNumGrowthTerms>(kDepthGrowth) =
      -z * FieldGrowth(seen.p.z()) *
      place.products.tail<kNumGrowthTerms>().cast<double>().transpose();
  return predicted;
}

DepthBeside::DepthBeside(const DepthReading& reading, const Eigen::Vector2d& offset_px) {
  // A plane is not extrapolated to twice the depth within the error of an image.
  constexpr double kFarthest = 0.5;
  const double inverse = 1.0 / reading.z_m;
  z_m = 1.0 / std::max(inverse + reading.inverse_slope_per_px.dot(offset_px), kFarthest * inverse);
  J_offset = -z_m * z_m * reading.inverse_slope_per_px.transpose();
}

}  // namespace plumb::bundle
