// SPDX-License-Identifier: Apache-2.0
// Compares two scenes of one patient: correction, maps and verdict.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "algo/base/message.hpp"
#include "algo/base/pose.hpp"
#include "algo/base/units.hpp"
#include "algo/comparison/body_parts.hpp"
#include "algo/comparison/calibrated_room.hpp"
#include "algo/comparison/correction.hpp"
#include "algo/comparison/motion_uncertainty.hpp"
#include "algo/comparison/scene_alignment.hpp"
#include "algo/motion/deformation.hpp"
#include "algo/motion/region.hpp"
#include "algo/types/height_map.hpp"
#include "algo/types/scene.hpp"
#include "algo/verdict/gates.hpp"

namespace plumb {

/// Input of Compare(). "Reference frame" means the reference marker's frame of the reference scene.
struct CompareOptions {
  Preset preset = Preset::kBest;
  std::vector<Eigen::Vector2d>
      region_polygon_m;  ///< x, y in the reference frame; empty: the segmented body.
  std::optional<Eigen::Vector3d>
      isocentre_m;  ///< In the reference frame; not set: centroid of the reference region.
  /// From the reference frame to the IEC fixed frame; not set: the orientation of the room is
  /// unknown. The numbers then refer to the reference marker's axes, and the direction words do not
  /// mention couch or gantry.
  std::optional<Pose> T_iec_reference;
  /// Only for a reference from a planning CT, where "reference frame" is the current scan's:
  /// half-widths of the 95 % interval of T_iec_reference at the isocentre. Not set: exact, with a
  /// warning.
  std::optional<double> iec_u95_m, iec_u95_rad;
  double calibration_u95_m = 0.0, calibration_u95_rad = 0.0;  ///< See CalibratedRoom.
  /// The taught markers of the room, in the frame that T_iec_reference maps from. Empty: that frame
  /// is found by the current scan's reference marker alone.
  MarkerMap room_markers;
  /// The reason for no answer where the room is needed and T_iec_reference is not set; empty: it
  /// was never calibrated.
  Message why_no_room = {};
  /// Set: the reference was scanned in another room than the current scan, and no marker is shared.
  /// Each scan is placed in IEC axes by its own room, the current one by the fields above.
  std::optional<CalibratedRoom> reference_room;
  /// Only for a reference from a planning CT; not set: as its scene states.
  std::optional<StatedSurface> surface = {};
  /// With kCouch only the posture is reported, no shifts.
  MarkerKind marker_kind = MarkerKind::kRoom;
  PatientPosture posture = PatientPosture::kHeadFirstSupine;  ///< Decides the words left and right.
  MarkerConsensusOptions markers;  ///< Decides when a marker counts as moved.
  AcceptanceLimits limits;  ///< Limits of the gates and the verdict; the same for every preset.

  std::function<double()> now_s;  ///< Wall clock for `Comparison::timings_s`; may be empty.
  /// Polled every few hundredths of a second; a stop request throws Interrupted.
  std::stop_token stop = {};
};

/// A direction that the surfaces hardly determine, such as the roll of a cylinder.
struct WeakDirection {
  std::string name;  ///< One of vertical, longitudinal, lateral, pitch, roll and yaw.
  double u95 = 0.0;  ///< Half-width of the 95 % interval.
  std::string unit;  ///< "mm" or "deg"
};

/// Rigid motion of the body: p_current = T * p_reference, both in the reference frame.
struct BodyMotion {
  Pose T = Pose::Identity();
  /// Rotation vector (rad), then translation (m); left perturbation about the moved centroid, T *
  /// centroid_m.
  Matrix6d covariance = Matrix6d::Zero();
  MotionUncertainty uncertainty;  ///< The causes that add up to `covariance`.
  Eigen::Vector3d centroid_m =
      Eigen::Vector3d::Zero();  ///< Centroid of the reference region in the reference frame.
  std::vector<WeakDirection> weak_directions;
  double residual_median_m = 0.0;  ///< Nearest-surface distance in the region after the fit.
  double residual_p95_m = 0.0;
  double inlier_fraction =
      0.0;  ///< Fraction of the region's points that the rigid motion explains, 0 to 1.
};

/// Content of a result. What could not be computed is absent, and `reasons` states why.
struct Comparison {
  Preset preset = Preset::kBest;  ///< How the numbers were made.
  /// Names of the sensor units' profiles from which the two scenes were made, if they were.
  std::optional<std::string> reference_profile, current_profile;
  std::optional<PlanningSource> planning;  ///< What the reference was, unless a sweep.
  Verdict verdict = Verdict::kNoAnswer;
  std::vector<Message> reasons;             ///< Complete sentences; the first one decides.
  NumberJudgements judgements{};            ///< Of the numbers of `correction`.
  AcceptanceLimits limits;                  ///< By which the verdict was reached.
  MarkerConsensusOptions marker_consensus;  ///< By which moved markers were found.
  std::optional<Alignment> alignment;
  std::optional<BodyMotion> motion;
  std::optional<Correction> correction;
  std::optional<RegionCoverage> region;
  std::optional<BodyParts> body_parts;  ///< Differences by part of the body.
  /// Non-rigid displacement that remains after the rigid motion.
  std::optional<Deformation> deformation;

  /// On the reference scene's grid; absent where the reference scene has no height map or the
  /// scenes could not be aligned.
  std::optional<HeightMap> deviation;  ///< Current minus reference height after alignment, metres.
  /// Nearest-surface distance; positive where the current surface lies outside (above).
  std::optional<HeightMap> distance;
  std::optional<HeightMap> current_height;   ///< The current surface in the reference frame.
  std::optional<HeightMap> deviation_after;  ///< As `deviation`, after the correction.
  std::vector<std::uint8_t>
      region_mask;  ///< 1 for the cells of the reference grid in the region; may be empty.

  std::vector<Message> warnings;
  std::map<std::string, double> timings_s;
};

/// Compares a current scan with its reference.
///
/// A reference from a planning CT (SceneFrame::kIec) is met through T_iec_reference, from the frame
/// of the current scene's reference marker: without it, or with fewer good markers in the current
/// scene than AcceptanceLimits::min_shared_markers, there is no answer. `motion` and `correction`
/// are then in that frame, while alignment, maps, region and parts of the body are in that of the
/// reference scene (IEC axes).
///
/// A reference from another room (CompareOptions::reference_room) is met in IEC axes, too; the
/// result is in the frame of the reference scene, as that of two scans in one room.
///
/// Otherwise the current scene may be in any frame (it need not have seen the reference marker),
/// because the shared markers align it. The reference scene must be in its reference marker's frame
/// and have a height map; otherwise the verdict is no_answer.
///
/// @throws DataError if the scenes used different marker dictionaries or marker lengths.
/// @throws std::invalid_argument if an option is out of range (tolerances <= 0, a polygon of fewer
///         than 3 points, values that are not finite).
/// @throws Interrupted on a stop request.
///
/// Thread-safe and deterministic: the same input gives the same result on any number of threads.
[[nodiscard]] Comparison Compare(const Scene& reference, const Scene& current,
                                 const CompareOptions& options = {});

}  // namespace plumb
