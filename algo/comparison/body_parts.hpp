// Where on the body two scans differ, in words: "left shoulder 9 mm high".
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "algo/base/pose.hpp"
#include "algo/comparison/correction.hpp"
#include "algo/comparison/deformation.hpp"
#include "algo/types/height_map.hpp"

namespace plumb {

/// A part of the region of interest and how far its surface lies from the reference's, up being
/// positive.
struct BodyPart {
  std::string name;  ///< "left shoulder", "left side at the head end"; by the room: "+X side at the
                     ///< gantry end"; by the marker: "+X side at the +Y end".
  Eigen::Vector3d centre_m =
      Eigen::Vector3d::Zero();  ///< Mean of its reference surface, reference frame.
  std::optional<double>
      now_m;  ///< How far it lies too high before any correction; absent with couch-fixed markers.
  double after_m = 0.0;  ///< What the rigid correction leaves: its posture.
  /// How far the part of it that moved most lies from its place once the correction is applied
  /// (mean over the most displaced 5 %, at least 20 cm2); reference frame. Absent without a field.
  std::optional<Eigen::Vector3d> largest_shift_m;
};

struct BodyParts {
  /// Names follow the patient's posture. False: posture unknown, or the body does not lie as it
  /// says; then no name holds a left or right.
  bool by_posture = false;
  bool is_room_known = true;           ///< False: T_iec_reference was never set.
  std::optional<PatientAxes> patient;  ///< Where head and left point; exactly where by_posture.
  std::vector<BodyPart> parts;         ///< From head to feet (by the room: from the gantry away).
};

/// What DescribeBody() looks at. All maps and masks share one grid, the reference scene's.
struct BodyView {
  const HeightMap& reference;
  const HeightMap&
      deviation_after;  ///< Current - reference height once the correction is applied; NaN unknown.
  const std::vector<std::uint8_t>& region_mask;  ///< 1: of the region of interest.
  const std::vector<std::uint8_t>& body_mask;  ///< 1: of the whole body; it locates the shoulders.
  Pose T_motion = Pose::Identity();  ///< p_current = T_motion * p_reference, reference frame.
  std::optional<Pose> T_iec_reference = Pose::Identity();  ///< None: never set.
  MarkerKind marker_kind = MarkerKind::kRoom;
  std::optional<PatientPosture> posture;     ///< None: unknown.
  const Deformation* deformation = nullptr;  ///< None: no shifts of parts.
};

/// Splits the region into parts and measures each.
///
/// A body whose neck is seen is named by shoulder, chest, abdomen, pelvis, thigh and lower leg; one
/// without by its ends. Which end is the head and which side is left follow from posture and
/// T_iec_reference; where the body's outline clearly lies across the axis that they state, neither
/// is believed. Without T_iec_reference the outline alone says where the head is: one end of a long
/// outline, and only one, shows head, neck and shoulders that are about as wide as anything else of
/// it; supine or prone then gives the left. `now_m` is the rise of the part under the rigid motion
/// plus what the motion leaves: a shift sideways lifts nothing. Parts of less than 20 cm2, or of
/// which less than a third was measured, are left out.
/// @throws std::invalid_argument if grids or masks differ in size.
[[nodiscard]] BodyParts DescribeBody(const BodyView& view);

/// "right thigh up to 40 mm to the right": the direction along the couch in which the part has
/// moved most. Empty where the patient's sides are unknown or the shift is within limit_m.
[[nodiscard]] std::string ShiftWords(const BodyPart& part, const PatientAxes& patient,
                                     double limit_m);

/// "left shoulder 9 mm high", "left shoulder 9 mm low"; empty within +-limit_m.
[[nodiscard]] std::string HeightWords(const BodyPart& part, double height_m, double limit_m);

}  // namespace plumb
