// The six numbers for the couch (IEC 61217).
#pragma once

#include <array>
#include <optional>
#include <string>

#include <Eigen/Core>

#include "algo/base/pose.hpp"

namespace plumb {

/// Whether the markers stay in the room or travel with the couch; stored with the reference.
enum class MarkerKind { kRoom, kCouch };
[[nodiscard]] const char* Name(MarkerKind kind);  ///< "room", "couch"

/// How the patient lies: which end points to the gantry, which side is up.
enum class PatientPosture { kHeadFirstSupine, kHeadFirstProne, kFeetFirstSupine, kFeetFirstProne };
[[nodiscard]] const char* Name(PatientPosture posture);  ///< "HFS", "HFP", "FFS", "FFP"

/// Where the patient's head and left side point, unit vectors in the plane (x, y) of the reference
/// marker.
struct PatientAxes {
  Eigen::Vector2d head = Eigen::Vector2d::UnitY();
  Eigen::Vector2d left = Eigen::Vector2d::UnitX();
};

/// Six values or their uncertainties. Shifts are absent where they are refused (couch-fixed
/// markers).
struct CouchNumbers {
  std::optional<double> vertical_mm;      ///< +Z, up.
  std::optional<double> longitudinal_mm;  ///< +Y, toward the gantry.
  std::optional<double> lateral_mm;       ///< +X, to the right of a viewer who faces the gantry.
  double pitch_deg = 0.0;                 ///< About X; > 0 lifts the end at the gantry.
  double roll_deg = 0.0;                  ///< About Y; > 0 lowers the viewer's right side.
  double yaw_deg = 0.0;                   ///< About Z; > 0 is counter-clockwise from above.
};

/// What to APPLY to the patient so that the body lies as in the reference.
struct Correction {
  Eigen::Vector3d isocentre_m = Eigen::Vector3d::Zero();  ///< Reference-marker frame.
  CouchNumbers value;
  CouchNumbers u95;  ///< 95 % half-widths.
  std::array<std::string, 6>
      words;  ///< Which way: vertical, longitudinal, lateral, pitch, roll, yaw; "" where refused.
};

/// The six numbers as a vector, in the order lateral, longitudinal, vertical (metres), pitch, roll,
/// yaw (radians).
///
/// C = T_iec_reference M^-1 T_iec_reference^-1 = (R, t); shift = R c + t - c at the isocentre c in
/// the IEC frame; R = Rz(yaw) Rx(pitch) Ry(roll).
[[nodiscard]] Vector6d CouchVector(const Pose& T_motion, const Eigen::Vector3d& isocentre_reference,
                                   const Pose& T_iec_reference);

/// Rotation of the angles: Rz(yaw) Rx(pitch) Ry(roll), radians.
[[nodiscard]] Eigen::Matrix3d CouchRotation(double pitch_rad, double roll_rad, double yaw_rad);

/// The correction of a body motion with its uncertainty, propagated to first order.
///
/// @param T_motion    p_current = T_motion * p_reference, reference-marker frame.
/// @param covariance  Of T_motion: rotation vector, translation; left perturbation about the moved
/// centroid, T_motion * centroid,
///                    so that its translation part is the uncertainty of where the centroid went.
/// @param centroid    Of the region in the reference scene, reference-marker frame.
/// @param T_iec_reference  None: nobody has said where the room lies. The numbers are along and
/// about the reference marker's axes, and no word speaks of couch or gantry.
/// @param posture     Turns the words into the patient's left, right and head; none: it is not to
/// be believed, the words are the room's, or the marker's where the room is not known.
/// @param patient     Needed for the patient's words where the room is not known; else not looked
/// at.
[[nodiscard]] Correction CorrectionOf(const Pose& T_motion, const Matrix6d& covariance,
                                      const Eigen::Vector3d& centroid,
                                      const Eigen::Vector3d& isocentre_reference,
                                      const std::optional<Pose>& T_iec_reference, MarkerKind kind,
                                      std::optional<PatientPosture> posture,
                                      const std::optional<PatientAxes>& patient = std::nullopt);

}  // namespace plumb
