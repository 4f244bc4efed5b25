// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/marker_face_term.hpp"

#include <algorithm>
#include <cmath>

namespace plumb::dense {
namespace {

constexpr double kFacePart = 0.9;        // Of the half side: cells on the rim mix two surfaces.
constexpr double kLeastIncidence = 0.2;  // Cosine; the noise model is not used below.

}  // namespace

MarkerFaceTerm::MarkerFaceTerm(const Sensor& of_view, const View& of_cell, std::size_t index,
                               const Pose& T_to_marker)
    : sensor(of_view),
      view(of_cell),
      cell(index),
      T_marker_depth(T_to_marker),
      in_marker(T_to_marker * of_cell.points[index].cast<double>()) {}

bool MarkerFaceTerm::IsOnFace(double half_side_m, double gate_m) const {
  return std::abs(in_marker.x()) <= kFacePart * half_side_m &&
         std::abs(in_marker.y()) <= kFacePart * half_side_m && std::abs(in_marker.z()) <= gate_m;
}

DepthRow MarkerFaceTerm::Linearise(const DepthNoise& noise) const {
  const Eigen::Vector3d n_depth = T_marker_depth.linear().row(2).transpose();
  const Eigen::Vector3d p = view.points[cell].cast<double>();
  const Eigen::Vector3d p_color = view.T_color_depth * p;
  const Eigen::Vector3d n_color = view.T_color_depth.linear() * n_depth;
  DepthRow row;
  row.J.setZero();
  row.J.segment<3>(kRotationA) = p_color.cross(n_color);
  row.J.segment<3>(kShiftA) = n_color;
  row.J.segment<3>(kRotationB) = -in_marker.cross(Eigen::Vector3d::UnitZ());
  row.J[kShiftB + 2] = -1.0;  // along z
  const DepthVector J_depth = DepthJacobian(view, cell);
  row.J.tail<CalibrationModel::kDepthSize>() =
      PositionJacobian(sensor, view, cell, J_depth, n_depth);
  row.J.segment<QuadraticTerm::kFocal>(QuadraticTerm::kFocalAt) =
      FocalJacobian(view, cell, n_depth);
  row.residual_m = in_marker.z();
  row.ConvertToRawUnits(view.slopes[cell], SlopeJacobian(view, cell));
  const double cosine = std::clamp(-n_depth.dot(p.normalized()), kLeastIncidence, 1.0);
  row.sigma_m = std::hypot(DepthSigma(noise, p.z(), cosine) * cosine, kUnmodelled_m);
  return row;
}

}  // namespace plumb::dense
