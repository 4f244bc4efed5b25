// Converts a body motion into the six couch numbers (IEC 61217).
#pragma once

#include <array>
#include <optional>
#include <string>

#include <Eigen/Core>

#include "algo/base/names.hpp"
#include "algo/base/pose.hpp"
#include "algo/base/posture.hpp"

namespace plumb {

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

/// The motion to APPLY to the patient so that the body lies as in the reference.
struct Correction {
  Eigen::Vector3d isocentre_m = Eigen::Vector3d::Zero();  ///< In the reference marker's frame.
  CouchNumbers value;
  CouchNumbers u95;  ///< Half-widths of the 95 % intervals.
  /// Directions of vertical, longitudinal, lateral, pitch, roll, yaw; "" where not reported.
  std::array<std::string, 6> words;
};

/// The six numbers as a vector, in the order lateral, longitudinal, vertical (metres), pitch, roll,
/// yaw (radians).
///
/// C = T_iec_reference M^-1 T_iec_reference^-1 = (R, t); shift = R c + t - c at the isocentre c in
/// the IEC frame; R = Rz(yaw) Rx(pitch) Ry(roll).
[[nodiscard]] Vector6d CouchVector(const Pose& T_motion, const Eigen::Vector3d& isocentre_reference,
                                   const Pose& T_iec_reference);

/// The correction of a body motion with its uncertainty, propagated to first order.
///
/// @param T_motion    p_current = T_motion * p_reference, in the reference marker's frame.
/// @param covariance  Covariance of T_motion: rotation vector, translation; left perturbation about
///         the moved centroid, T_motion * centroid, so that its translation part is the uncertainty
///         of the centroid's new position.
/// @param centroid    Centroid of the region in the reference scene, reference marker's frame.
/// @param T_iec_reference  Not set: the orientation of the room is unknown. The numbers then refer
///         to the reference marker's axes, and the words do not mention couch or gantry.
/// @param posture     Selects the patient's left, right and head for the words. Not set: the words
///         refer to the room, or to the marker where the room is unknown.
/// @param patient     Used for the words only where the room is unknown.
[[nodiscard]] Correction CorrectionOf(const Pose& T_motion, const Matrix6d& covariance,
                                      const Eigen::Vector3d& centroid,
                                      const Eigen::Vector3d& isocentre_reference,
                                      const std::optional<Pose>& T_iec_reference, MarkerKind kind,
                                      std::optional<PatientPosture> posture,
                                      const std::optional<PatientAxes>& patient = std::nullopt);

}  // namespace plumb
