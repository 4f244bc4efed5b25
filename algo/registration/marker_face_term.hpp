// SPDX-License-Identifier: Apache-2.0
// The residual of a cell of a depth image to the face of the marker that it shows.
#pragma once

#include "algo/registration/depth_row.hpp"
#include "algo/sensor_model/depth_noise.hpp"

namespace plumb::dense {

/// Depth measured on a marker's face lies in the marker's plane, which ties the scale of the depth
/// to the markers' side length. With the corrected point x of a cell, the marker's pose M, and the
/// cell's depth as measured and as corrected (z_raw, z):
///
///     r = (M^-1 T_world_depth x).z z_raw / z
///
/// in the twists of the keyframe and the marker, the focal lengths and the depth calibration.
struct MarkerFaceTerm {
  MarkerFaceTerm(const Sensor& of_view, const View& of_cell, std::size_t index,
                 const Pose& T_to_marker);

  const Sensor& sensor;
  const View& view;
  std::size_t cell = 0;
  const Pose& T_marker_depth;
  Eigen::Vector3d in_marker;

  /// Whether the cell lies within the printed square, apart from its rim, and near its plane.
  [[nodiscard]] bool IsOnFace(double half_side_m, double gate_m) const;
  [[nodiscard]] DepthRow Linearise(const DepthNoise& noise) const;
};

}  // namespace plumb::dense
