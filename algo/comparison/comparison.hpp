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

#include "algo/comparison/body_parts.hpp"
#include "algo/comparison/correction.hpp"
#include "algo/types/height_map.hpp"
#include "algo/types/pose.hpp"
#include "algo/types/scene.hpp"
#include "algo/types/units.hpp"

namespace plumb {

enum class Verdict { kInTolerance, kMove, kNoAnswer };
[[nodiscard]] const char* Name(Verdict verdict);  ///< "in_tolerance", "move", "no_answer"

/// What Compare() is asked for. "Reference frame" is the reference marker's frame of the reference scene.
struct CompareOptions {
  Preset preset = Preset::kBest;
  std::vector<Eigen::Vector2d> region_polygon_m;              ///< x, y in the reference frame; empty: the segmented body.
  std::optional<Eigen::Vector3d> isocentre_m;                 ///< Reference frame; none: centroid of the reference region.
  Pose T_iec_reference = Pose::Identity();                    ///< Reference frame to the IEC fixed frame.
  MarkerKind marker_kind = MarkerKind::kRoom;                 ///< kCouch: shifts are refused, posture only.
  PatientPosture posture = PatientPosture::kHeadFirstSupine;  ///< For the words left and right.
  double shift_tolerance_m = 3 * kMillimetre;                 ///< Per axis.
  double rotation_tolerance_rad = 1 * kDegree;                ///< Per axis.

  int min_shared_markers = 3;                    ///< Fewer good ones: no answer (preset `best`).
  double moved_marker_m = 5 * kMillimetre;       ///< A marker moved if it is off by more than this ...
  double moved_marker_sigmas = 3.0;              ///< ... and by more than this many of its own standard deviations.
  double min_coverage = 0.9;                     ///< Share of the region that the current scan must have measured.
  double max_hole_m = 5 * kCentimetre;           ///< Largest hole of the region, as a diameter.
  double max_residual_p95_m = 25 * kMillimetre;  ///< Beyond: "does not look like this reference".
  double max_lost_s = 1.0;                       ///< Longest time without tracking in either scan.

  std::function<double()> now_s;  ///< Wall clock for `Comparison::timings_s`; none: no timings.
  std::stop_token stop = {};      ///< Polled every few hundredths of a second.
};

/// Current scene onto reference scene, from the shared markers.
struct Alignment {
  Pose T_reference_current = Pose::Identity();
  /// Preset `best`: how the current marker map must be stretched within its plane to become as long and as wide as the reference's
  /// (a hand-held scan is some tenths of a percent too long or short, rooms are not); symmetric, 1 across the plane, where
  /// depth itself gives the scale. Applied about `centre_m` after T_reference_current, which is the rigid fit.
  Eigen::Matrix3d stretch = Eigen::Matrix3d::Identity();
  double rms_m = 0.0;                                  ///< Over the corners used, rigid.
  std::vector<int> markers_used;                       ///< Ids, ascending.
  std::map<int, double> markers_rejected;              ///< Id to its residual against the others, metres.
  Matrix6d covariance = Matrix6d::Zero();              ///< Rotation vector, translation; left perturbation about `centre_m`.
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();  ///< Weighted centroid of the corners used, reference frame.
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
  /// Rotation vector (rad), translation (m); left perturbation about the centroid where the motion took it, T * centroid_m.
  Matrix6d covariance = Matrix6d::Zero();
  Eigen::Vector3d centroid_m = Eigen::Vector3d::Zero();  ///< Of the reference region, reference frame.
  std::vector<WeakDirection> weak_directions;
  double residual_median_m = 0.0;  ///< Nearest-surface distance in the region after the fit.
  double residual_p95_m = 0.0;
  double inlier_share = 0.0;  ///< Share of the region's points that the rigid motion explains, 0..1.
};

/// What of the region the current scan measured, after the motion is taken into account.
struct RegionCoverage {
  double coverage = 0.0;                                    ///< Share 0..1 of the region's valid reference cells.
  double largest_hole_m = 0.0;                              ///< Diameter of the largest disc inside the region without current data.
  Eigen::Vector2d hole_centre_m = Eigen::Vector2d::Zero();  ///< Reference frame.
};

/// Everything of a RESULT. What could not be computed is absent, and `reasons` say why.
struct Comparison {
  Verdict verdict = Verdict::kNoAnswer;
  std::vector<std::string> reasons;  ///< Sentences; the first decides.
  std::optional<Alignment> alignment;
  std::optional<BodyMotion> motion;
  std::optional<Correction> correction;
  std::optional<RegionCoverage> region;
  std::optional<BodyParts> body_parts;  ///< Where on the body, in words.

  /// On the reference scene's grid; absent where the reference scene has no height map or nothing could be aligned.
  std::optional<HeightMap> deviation;        ///< Current - reference height after alignment, metres.
  std::optional<HeightMap> distance;         ///< Nearest-surface distance, > 0 where current lies outside (above).
  std::optional<HeightMap> current_height;   ///< The current surface in the reference frame.
  std::optional<HeightMap> deviation_after;  ///< As `deviation`, once the correction is applied.
  std::vector<std::uint8_t> region_mask;     ///< 1 where a cell of the reference grid belongs to the region; or empty.

  std::vector<std::string> warnings;
  std::map<std::string, double> timings_s;
};

/// Compares a current scan with its reference.
///
/// The current scene may lie in any frame (it need not have seen the reference marker): the shared markers align it.
/// The reference scene must be in its reference marker's frame and have a height map, else the verdict is no_answer.
///
/// @throws DataError if the scenes used another marker dictionary or marker length.
/// @throws std::invalid_argument if an option is out of range (tolerances <= 0, a polygon of fewer than 3 points,
///         values that are not finite). Interrupted on a stop request.
///
/// Thread-safe and deterministic: same input, same result, whatever the number of threads.
[[nodiscard]] Comparison Compare(const Scene& reference, const Scene& current, const CompareOptions& options = {});

}  // namespace plumb
