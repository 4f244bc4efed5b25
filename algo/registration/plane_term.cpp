// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/plane_term.hpp"

#include <cmath>

namespace plumb::dense {
namespace {

constexpr float kMinNormalAgreement = 0.8F;  // Cosine between the two normals of a correspondence.
constexpr float kMinIncidence = 0.35F;       // Cosine of the steepest incidence used.

}  // namespace

ViewPair::ViewPair(const Sensor& of_both, const View& from, const View& to)
    : sensor(of_both), a(from), b(to), T_b_a(to.T_world_depth.inverse() * from.T_world_depth) {}

std::optional<PlaneTerm> PlaneTerm::Between(const ViewPair& pair, std::size_t cell_a,
                                            std::size_t cell_b, const Eigen::Vector3f& in_b,
                                            const Eigen::Matrix3f& R_b_a, double gate_m) {
  const Eigen::Vector3f& normal_a = pair.a.keyframe->dense.normals[cell_a];
  const Eigen::Vector3f& n = pair.b.keyframe->dense.normals[cell_b];
  if (n.isZero() || n.dot(R_b_a * normal_a) < kMinNormalAgreement) return std::nullopt;
  const Eigen::Vector3f& p_b = pair.b.points[cell_b];
  PlaneTerm term;
  term.distance_m = n.dot(in_b - p_b);
  if (std::abs(term.distance_m) > gate_m) return std::nullopt;
  term.cos_b = -n.dot(p_b.normalized());
  term.cos_a = -normal_a.dot(pair.a.points[cell_a].normalized());
  if (term.cos_b < kMinIncidence || term.cos_a < kMinIncidence) return std::nullopt;
  term.cell_a = cell_a;
  term.cell_b = cell_b;
  term.in_b = in_b;
  term.normal = n;
  return term;
}

PlaneTerm::Sigmas PlaneTerm::SigmasOf(const ViewPair& pair, const DepthNoise& noise) const {
  return {DepthSigma(noise, pair.a.points[cell_a].z(), cos_a) * cos_a,
          DepthSigma(noise, pair.b.points[cell_b].z(), cos_b) * cos_b};
}

DepthRow PlaneTerm::Linearise(const ViewPair& pair, const DepthNoise& noise) const {
  const View& a = pair.a;
  const View& b = pair.b;
  const Eigen::Vector3d n_b = normal.cast<double>();
  const Eigen::Vector3d n_a = pair.T_b_a.linear().transpose() * n_b;
  const Eigen::Vector3d p_color = a.T_color_depth * a.points[cell_a].cast<double>();
  const Eigen::Vector3d n_color_a = a.T_color_depth.linear() * n_a;
  const Eigen::Vector3d q_color = b.T_color_depth * in_b.cast<double>();
  const Eigen::Vector3d n_color_b = b.T_color_depth.linear() * n_b;
  DepthRow row;
  row.J.segment<3>(kRotationA) = p_color.cross(n_color_a);
  row.J.segment<3>(kShiftA) = n_color_a;
  row.J.segment<3>(kRotationB) = -q_color.cross(n_color_b);
  row.J.segment<3>(kShiftB) = -n_color_b;
  const DepthVector J_depth = DepthJacobian(a, cell_a);
  row.J.segment<QuadraticTerm::kFocal>(QuadraticTerm::kFocalAt) =
      FocalJacobian(a, cell_a, n_a) - FocalJacobian(b, cell_b, n_b);
  row.J.tail<CalibrationModel::kDepthSize>() =
      PositionJacobian(pair.sensor, a, cell_a, J_depth, n_a) -
      PositionJacobian(pair.sensor, b, cell_b, DepthJacobian(b, cell_b), n_b);
  row.residual_m = distance_m;
  const Sigmas sigmas = SigmasOf(pair, noise);
  // Each cell's noise is multiplied by its own slope; this is the slope of their sum.
  const double variance = sigmas.a_m * sigmas.a_m + sigmas.b_m * sigmas.b_m;
  const double share_a = sigmas.a_m * sigmas.a_m / variance;
  const double slope_a = a.slopes[cell_a], slope_b = b.slopes[cell_b];
  const double slope = std::sqrt(share_a * slope_a * slope_a + (1 - share_a) * slope_b * slope_b);
  row.ConvertToRawUnits(slope, share_a * slope_a / slope * SlopeJacobian(a, cell_a) +
                                   (1 - share_a) * slope_b / slope * SlopeJacobian(b, cell_b));
  row.sigma_m = std::sqrt(variance + kUnmodelled_m * kUnmodelled_m);
  return row;
}

}  // namespace plumb::dense
