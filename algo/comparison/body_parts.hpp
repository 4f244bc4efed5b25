// SPDX-License-Identifier: Apache-2.0
// Describes in words where on the body two scans differ, such as "left shoulder 9 mm high".
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "algo/base/message.hpp"
#include "algo/base/pose.hpp"
#include "algo/comparison/correction.hpp"
#include "algo/motion/deformation.hpp"
#include "algo/types/height_map.hpp"

namespace plumb {

/// A part of the region of interest and the distance of its surface from the reference's (positive
/// is up).
struct BodyPart {
  /// For example "left shoulder" or "left side at the head end"; named by the room "+X side at the
  /// gantry end", by the marker "+X side at the +Y end".
  Message name;
  Eigen::Vector3d centre_m =
      Eigen::Vector3d::Zero();  ///< Mean of its reference surface in the reference frame.
  /// Height above the reference before any correction; absent with couch-fixed markers.
  std::optional<double> now_m;
  /// Height above the reference that remains after the rigid correction (posture).
  double after_m = 0.0;
  /// Mean displacement of the most displaced 5 % of the part (at least 20 cm2) after the
  /// correction, in the reference frame. Absent without a deformation field.
  std::optional<Eigen::Vector3d> largest_shift_m;
};

/// Directions of the room on a map of the reference marker's plane, unit vectors: toward the
/// gantry, and to the right of a person who faces it.
struct RoomWays {
  Eigen::Vector2d gantry = Eigen::Vector2d::UnitY();
  Eigen::Vector2d right = Eigen::Vector2d::UnitX();
};

[[nodiscard]] RoomWays WaysOfRoom(const Pose& T_iec_reference);

/// Directions of head and left of a patient who lies exactly along the room's axes.
[[nodiscard]] PatientAxes SidesOf(const RoomWays& room, PatientPosture posture);

struct BodyParts {
  /// True if names follow the patient's posture. False if the posture is unknown or the body does
  /// not lie as it states; names then do not mention left or right.
  bool by_posture = false;
  /// The surface shows the head at the end that posture and room state to be the feet's: one of
  /// them is wrong, and names follow the room alone.
  bool head_at_other_end = false;
  std::optional<RoomWays> room;  ///< Not set without T_iec_reference.
  /// Directions of head and left; exact where by_posture is set.
  std::optional<PatientAxes> patient;
  std::vector<BodyPart> parts;  ///< Ordered from head to feet (by the room: from the gantry away).
  /// Name of the part that BodyView::hole_centre_m lies on; empty without one.
  Message hole_place;
};

/// Input of DescribeBody(). All maps and masks share the reference scene's grid.
struct BodyView {
  const HeightMap& reference;
  const HeightMap&
      deviation_after;  ///< Current minus reference height after the correction; NaN where unknown.
  const std::vector<std::uint8_t>& region_mask;  ///< 1 for cells of the region of interest.
  /// 1 for cells of the whole body; used to locate the shoulders.
  const std::vector<std::uint8_t>& body_mask;
  Pose T_motion = Pose::Identity();  ///< p_current = T_motion * p_reference, reference frame.
  std::optional<Pose> T_iec_reference = Pose::Identity();  ///< Not set: room orientation unknown.
  MarkerKind marker_kind = MarkerKind::kRoom;
  std::optional<PatientPosture> posture;     ///< Not set: posture unknown.
  const Deformation* deformation = nullptr;  ///< May be null: no displacements of parts.
  /// Middle of the largest hole, in the reference frame. Not set: there is none to name.
  std::optional<Eigen::Vector2d> hole_centre_m = std::nullopt;
};

/// Splits the region into parts and measures each.
///
/// A body whose neck is visible is named by shoulder, chest, abdomen, pelvis, thigh and lower leg,
/// one without by its ends. Posture and T_iec_reference state which end is the head and which side
/// is left; where the body's outline clearly lies across the axis that they state, or shows head
/// and shoulders at the other end only, neither is used.
///
/// Without T_iec_reference the outline alone decides where the head is: exactly one end of a long
/// outline must show head, neck and shoulders that are about as wide as the widest other part. The
/// posture (supine or prone) then gives the left side.
///
/// `now_m` is the rise of the part under the rigid motion plus the remaining deviation, so that a
/// sideways shift does not count as a rise. Parts smaller than 20 cm2, or measured by less than a
/// third, are left out.
/// @throws std::invalid_argument if grids or masks differ in size.
[[nodiscard]] BodyParts DescribeBody(const BodyView& view);

/// Direction along the couch in which the part has moved most, such as "right thigh up to 40 mm to
/// the right". Empty where the patient's sides are unknown or the displacement is within limit_m.
[[nodiscard]] Message ShiftWords(const BodyPart& part, const PatientAxes& patient, double limit_m);

/// "left shoulder 9 mm high", "left shoulder 9 mm low"; empty within +-limit_m.
[[nodiscard]] Message HeightWords(const BodyPart& part, double height_m, double limit_m);

}  // namespace plumb
