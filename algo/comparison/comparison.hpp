// Two scenes of one patient become a correction, maps and a verdict.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "algo/acceptance/acceptance.hpp"
#include "algo/base/pose.hpp"
#include "algo/base/units.hpp"
#include "algo/comparison/body_parts.hpp"
#include "algo/comparison/correction.hpp"
#include "algo/comparison/deformation.hpp"
#include "algo/comparison/motion_uncertainty.hpp"
#include "algo/comparison/region.hpp"
#include "algo/comparison/scene_alignment.hpp"
#include "algo/types/height_map.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// What Compare() is asked for. "Reference frame" is the reference marker's frame of the reference
/// scene.
struct CompareOptions {
  Preset preset = Preset::kBest;
  std::vector<Eigen::Vector2d>
      region_polygon_m;  ///< x, y in the reference frame; empty: the segmented body.
  std::optional<Eigen::Vector3d>
      isocentre_m;  ///< Reference frame; none: centroid of the reference region.
  /// Reference frame to the IEC fixed frame; none: nobody has said how the room lies. The numbers
  /// are then along the reference marker's axes, and no word speaks of couch or gantry.
  std::optional<Pose> T_iec_reference;
  MarkerKind marker_kind = MarkerKind::kRoom;  ///< kCouch: shifts are refused, posture only.
  PatientPosture posture = PatientPosture::kHeadFirstSupine;  ///< For the words left and right.
  MarkerConsensusOptions markers;                             ///< When a marker counts as moved.
  AcceptanceLimits limits;  ///< Of the gates and the verdict; the same for every preset.

  std::function<double()> now_s;  ///< Wall clock for `Comparison::timings_s`; none: no timings.
  std::stop_token stop = {};      ///< Polled every few hundredths of a second.
};

/// A direction in which the surfaces say little, e.g. roll of a cylinder.
struct WeakDirection {
  std::string name;  ///< One of the six numbers: vertical, longitudinal, lateral, pitch, roll, yaw.
  double u95 = 0.0;  ///< 95 % half-width.
  std::string unit;  ///< "mm" or "deg"
};

/// Rigid motion of the body: p_current = T * p_reference, both in the reference frame.
struct BodyMotion {
  Pose T = Pose::Identity();
  /// Rotation vector (rad), translation (m); left perturbation about the centroid where the motion
  /// took it, T * centroid_m.
  Matrix6d covariance = Matrix6d::Zero();
  MotionUncertainty uncertainty;  ///< Whose total `covariance` is.
  Eigen::Vector3d centroid_m =
      Eigen::Vector3d::Zero();  ///< Of the reference region, reference frame.
  std::vector<WeakDirection> weak_directions;
  double residual_median_m = 0.0;  ///< Nearest-surface distance in the region after the fit.
  double residual_p95_m = 0.0;
  double inlier_share =
      0.0;  ///< Share of the region's points that the rigid motion explains, 0..1.
};

/// Everything of a RESULT. What could not be computed is absent, and `reasons` say why.
struct Comparison {
  Preset preset = Preset::kBest;  ///< How the numbers were made.
  Verdict verdict = Verdict::kNoAnswer;
  std::vector<std::string> reasons;  ///< Sentences; the first decides.
  std::optional<Alignment> alignment;
  std::optional<BodyMotion> motion;
  std::optional<Correction> correction;
  std::optional<RegionCoverage> region;
  std::optional<BodyParts> body_parts;     ///< Where on the body, in words.
  std::optional<Deformation> deformation;  ///< What the rigid motion leaves, as a field.

  /// On the reference scene's grid; absent where the reference scene has no height map or nothing
  /// could be aligned.
  std::optional<HeightMap> deviation;  ///< Current - reference height after alignment, metres.
  std::optional<HeightMap>
      distance;  ///< Nearest-surface distance, > 0 where current lies outside (above).
  std::optional<HeightMap> current_height;   ///< The current surface in the reference frame.
  std::optional<HeightMap> deviation_after;  ///< As `deviation`, once the correction is applied.
  std::vector<std::uint8_t>
      region_mask;  ///< 1 where a cell of the reference grid belongs to the region; or empty.

  std::vector<std::string> warnings;
  std::map<std::string, double> timings_s;
};

/// Compares a current scan with its reference.
///
/// The current scene may lie in any frame (it need not have seen the reference marker): the shared
/// markers align it. The reference scene must be in its reference marker's frame and have a height
/// map, else the verdict is no_answer.
///
/// @throws DataError if the scenes used another marker dictionary or marker length.
/// @throws std::invalid_argument if an option is out of range (tolerances <= 0, a polygon of fewer
/// than 3 points,
///         values that are not finite). Interrupted on a stop request.
///
/// Thread-safe and deterministic: same input, same result, whatever the number of threads.
[[nodiscard]] Comparison Compare(const Scene& reference, const Scene& current,
                                 const CompareOptions& options = {});

}  // namespace plumb
