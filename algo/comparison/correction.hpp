// SPDX-License-Identifier: Apache-2.0
// Converts a body motion into the six couch numbers (IEC 61217).
#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "algo/base/message.hpp"
#include "algo/base/pose.hpp"
#include "algo/base/posture.hpp"
#include "algo/comparison/couch_numbers.hpp"

namespace plumb {

/// The motion to APPLY to the patient so that the body lies as in the reference.
struct Correction {
  Eigen::Vector3d isocentre_m = Eigen::Vector3d::Zero();  ///< In the reference marker's frame.
  CouchNumbers value;
  CouchNumbers u95;  ///< Half-widths of the 95 % intervals.
  /// Directions of vertical, longitudinal, lateral, pitch, roll, yaw; empty where not reported.
  std::array<Message, 6> words;
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
