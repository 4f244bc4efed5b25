// SPDX-License-Identifier: Apache-2.0
// The projective map from a square to a quadrilateral in closed form.
#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Core>

#include "algo/types/marker.hpp"

namespace plumb {

/// Maps the square with corners (0,0), (side,0), (side,side), (0,side) to the quadrilateral's
/// corners in this order. Nothing if the quadrilateral is degenerate (three corners on a line).
[[nodiscard]] inline std::optional<Eigen::Matrix3d> SquareToQuad(double side,
                                                                 const ImageCorners& quad) {
  const Eigen::Vector2d d1 = quad[1] - quad[2];
  const Eigen::Vector2d d2 = quad[3] - quad[2];
  const Eigen::Vector2d s = quad[0] - quad[1] + quad[2] - quad[3];
  const double determinant = d1.x() * d2.y() - d2.x() * d1.y();
  if (!(std::abs(determinant) > 1e-9)) return std::nullopt;
  const double g = (s.x() * d2.y() - d2.x() * s.y()) / determinant;
  const double h = (d1.x() * s.y() - s.x() * d1.y()) / determinant;
  Eigen::Matrix3d H;
  H << quad[1].x() - quad[0].x() + g * quad[1].x(), quad[3].x() - quad[0].x() + h * quad[3].x(),
      quad[0].x(),  //
      quad[1].y() - quad[0].y() + g * quad[1].y(), quad[3].y() - quad[0].y() + h * quad[3].y(),
      quad[0].y(),  //
      g, h, 1;
  H.leftCols<2>() /= side;
  return H;
}

}  // namespace plumb
