// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/world/body.hpp"

#include <algorithm>
#include <cmath>

namespace plumb::simulated {
namespace {

using Eigen::Vector3d;

// First-order distance to an ellipsoid's surface.
double Ellipsoid(const Vector3d& p, const Vector3d& centre, const Vector3d& radii) {
  const Vector3d q = (p - centre).cwiseQuotient(radii);
  const double norm = q.norm();
  const double slope = q.cwiseQuotient(radii).norm();
  return slope > 1e-9 ? norm * (norm - 1.0) / slope : -radii.minCoeff();
}

// A capsule whose radius changes linearly from a to b.
double TaperedCapsule(const Vector3d& p, const Vector3d& a, const Vector3d& b, double radius_a,
                      double radius_b) {
  const Vector3d axis = b - a;
  const double along = std::clamp((p - a).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
  return (p - a - along * axis).norm() - (radius_a + along * (radius_b - radius_a));
}

// Quadratic smooth minimum: equals min(a, b) where they differ by more than k.
double SmoothMin(double a, double b, double k) {
  const double h = std::max(0.0, k - std::abs(a - b)) / k;
  return std::min(a, b) - 0.25 * h * h * k;
}

double SmoothMax(double a, double b, double k) { return -SmoothMin(-a, -b, k); }

double Trunk(const BodyShape& shape, const Vector3d& p) {
  const double chest = shape.chest_rise_m;
  const double belly = shape.belly_rise_m;
  double d = Ellipsoid(p, {-0.17, 0.0, 0.100 + chest / 2}, {0.215, 0.162, 0.103 + chest / 2});
  d = SmoothMin(d, Ellipsoid(p, {0.06, 0.004, 0.090 + belly / 2}, {0.20, 0.136, 0.088 + belly / 2}),
                0.06);
  d = SmoothMin(d, Ellipsoid(p, {0.235, -0.003, 0.094}, {0.150, 0.170, 0.098}), 0.06);
  // Shoulder girdle and the slope to the neck; the left shoulder is slightly higher and farther
  // back.
  d = SmoothMin(d, TaperedCapsule(p, {-0.270, -0.155, 0.097}, {-0.283, 0.155, 0.104}, 0.058, 0.061),
                0.05);
  d = SmoothMin(d, TaperedCapsule(p, {-0.290, 0.0, 0.105}, {-0.430, 0.010, 0.118}, 0.066, 0.050),
                0.05);
  // Chest relief, different on the two sides.
  d = SmoothMin(d, Ellipsoid(p, {-0.165, -0.076, 0.172 + chest}, {0.078, 0.070, 0.044}), 0.04);
  d = SmoothMin(d, Ellipsoid(p, {-0.172, 0.080, 0.167 + chest}, {0.074, 0.066, 0.042}), 0.04);
  // Lower belly, and the hip bones.
  d = SmoothMin(d, Ellipsoid(p, {0.150, 0.006, 0.142 + belly}, {0.100, 0.085, 0.048}), 0.06);
  d = SmoothMin(d, Ellipsoid(p, {0.195, -0.125, 0.142}, {0.055, 0.035, 0.032}), 0.04);
  d = SmoothMin(d, Ellipsoid(p, {0.200, 0.122, 0.139}, {0.052, 0.034, 0.033}), 0.04);
  // Navel, and the notch between the collar bones.
  d = SmoothMax(d, -Ellipsoid(p, {0.062, 0.006, 0.186 + belly}, {0.016, 0.012, 0.020}), 0.015);
  d = SmoothMax(d, -Ellipsoid(p, {-0.335, 0.004, 0.186}, {0.020, 0.022, 0.022}), 0.02);
  return d;
}

double Torso(const BodyShape& shape, const Vector3d& p) {
  double d = Trunk(shape, p);
  // Arm stumps of unequal length, then the thighs.
  d = SmoothMin(d, TaperedCapsule(p, {-0.262, 0.175, 0.098}, {-0.120, 0.222, 0.086}, 0.052, 0.045),
                0.04);
  d = SmoothMin(
      d, TaperedCapsule(p, {-0.255, -0.175, 0.094}, {-0.165, -0.212, 0.082}, 0.052, 0.046), 0.04);
  const double thighs =
      std::min(TaperedCapsule(p, {0.27, -0.086, 0.092}, {0.55, -0.100, 0.086}, 0.086, 0.074),
               TaperedCapsule(p, {0.27, 0.084, 0.092}, {0.55, 0.104, 0.080}, 0.085, 0.073));
  d = SmoothMin(d, thighs, 0.035);
  // Flat ends: the neck is cut at a slant, each thigh square.
  d = SmoothMax(d, -(p.x() + 0.400) * 0.98 - (p.z() - 0.115) * 0.20, 0.010);
  return SmoothMax(d, p.x() - (p.y() < 0 ? 0.440 : 0.425), 0.010);
}

double Arm(const Vector3d& p, double side, double abduction_rad) {
  // The arm lies beside the trunk and turns about the shoulder, in the horizontal plane.
  const Vector3d shoulder(-0.265, side * 0.175, 0.095);
  const Vector3d q =
      shoulder + Eigen::AngleAxisd(side * abduction_rad, Vector3d::UnitZ()) * (p - shoulder);
  const Vector3d elbow(0.015, side * 0.262, 0.062);
  const Vector3d wrist(0.255, side * 0.292, 0.052);
  double d = TaperedCapsule(q, shoulder, elbow, 0.056, 0.042);
  d = SmoothMin(d, TaperedCapsule(q, elbow, wrist, 0.043, 0.029), 0.03);
  d = SmoothMin(
      d, Ellipsoid(q, wrist + Vector3d(0.085, side * 0.004, -0.012), {0.082, 0.040, 0.019}), 0.03);
  return SmoothMin(d,
                   TaperedCapsule(q, wrist + Vector3d(0.03, -side * 0.022, 0.0),
                                  wrist + Vector3d(0.085, -side * 0.048, 0.0), 0.016, 0.011),
                   0.02);
}

double Leg(const Vector3d& p, double side) {
  const Vector3d hip(0.27, side * 0.086, 0.092);
  const Vector3d knee(0.655, side * 0.108, 0.080);
  const Vector3d ankle(1.050, side * (0.122 + 0.012 * (side > 0)), 0.052);
  double d = TaperedCapsule(p, hip, knee, 0.088, 0.060);
  d = SmoothMin(d, TaperedCapsule(p, knee, ankle, 0.058, 0.037), 0.03);
  d = SmoothMin(d, Ellipsoid(p, {0.80, side * 0.113, 0.062}, {0.15, 0.055, 0.056}), 0.04);
  return SmoothMin(d,
                   TaperedCapsule(p, ankle + Vector3d(0.028, 0, -0.01),
                                  ankle + Vector3d(0.045, side * 0.045, 0.165), 0.040, 0.030),
                   0.03);
}

double Head(const Vector3d& p) {
  double d = Ellipsoid(p, {-0.560, 0.010, 0.108}, {0.118, 0.078, 0.100});
  d = SmoothMin(d, Ellipsoid(p, {-0.500, 0.011, 0.140}, {0.065, 0.055, 0.060}), 0.03);  // jaw
  return SmoothMin(d,
                   TaperedCapsule(p, {-0.575, 0.011, 0.203}, {-0.535, 0.012, 0.216}, 0.010, 0.014),
                   0.015);  // nose
}

double FullBody(const BodyShape& shape, const Vector3d& p) {
  double d = Trunk(shape, p);
  d = SmoothMin(d, Head(p), 0.04);
  d = SmoothMin(d, std::min(Leg(p, -1.0), Leg(p, 1.0)), 0.035);
  return SmoothMin(d, std::min(Arm(p, -1.0, shape.right_arm_abduction_rad), Arm(p, 1.0, 0.03)),
                   0.03);
}

}  // namespace

double BodyImplicit(const BodyShape& shape, const Vector3d& p_body) {
  return shape.kind == BodyKind::kTorso ? Torso(shape, p_body) : FullBody(shape, p_body);
}

Eigen::AlignedBox3d BodyBox(const BodyShape& shape) {
  if (shape.kind == BodyKind::kTorso)
    return {Vector3d(-0.47, -0.31, -0.05), Vector3d(0.50, 0.31, 0.27)};
  const double reach = 0.40 + 0.62 * std::sin(std::clamp(shape.right_arm_abduction_rad, 0.0, 1.2));
  return {Vector3d(-0.73, -reach, -0.05), Vector3d(1.19, 0.40, 0.29)};
}

}  // namespace plumb::simulated
