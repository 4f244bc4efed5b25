// SPDX-License-Identifier: Apache-2.0
// The six numbers of the couch (IEC 61217), and what decides how they are named.
#pragma once

#include <optional>

#include <Eigen/Core>

#include "algo/base/names.hpp"

namespace plumb {

/// Components of a vector of the six, such as CouchVector().
namespace couch {
enum Component : Eigen::Index { kLateral, kLongitudinal, kVertical, kPitch, kRoll, kYaw };
}

/// Whether the markers are fixed to the room or to the couch; stored with the reference.
enum class MarkerKind { kRoom, kCouch };
template <>
inline constexpr auto kNamesOf<MarkerKind> = NamesUpTo<MarkerKind::kCouch>({"room", "couch"});

/// Directions of the patient's head and left side, unit vectors in the plane (x, y) of the
/// reference marker.
struct PatientAxes {
  Eigen::Vector2d head = Eigen::Vector2d::UnitY();
  Eigen::Vector2d left = Eigen::Vector2d::UnitX();
};

/// Six values or their uncertainties. Shifts are absent with couch-fixed markers.
struct CouchNumbers {
  std::optional<double> vertical_mm;      ///< +Z, up.
  std::optional<double> longitudinal_mm;  ///< +Y, toward the gantry.
  std::optional<double> lateral_mm;       ///< +X, to the right of a viewer who faces the gantry.
  double pitch_deg = 0.0;                 ///< About X; positive lifts the gantry end.
  double roll_deg = 0.0;                  ///< About Y; positive lowers the viewer's right side.
  double yaw_deg = 0.0;                   ///< About Z; positive is counter-clockwise from above.
};

}  // namespace plumb
