// Where the current scene lies in the reference scene, from the markers that both saw.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "algo/acceptance/acceptance.hpp"
#include "algo/base/pose.hpp"
#include "algo/base/units.hpp"
#include "algo/types/marker.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// When a marker counts as moved: by more than `moved_m` and by more than `moved_sigmas` of its own
/// standard deviation, so that noise alone names no marker.
struct MarkerConsensusOptions {
  double moved_m = 5 * kMillimetre;
  double moved_sigmas = 3.0;
};

/// Current scene onto reference scene, from the shared markers.
struct Alignment {
  Pose T_reference_current = Pose::Identity();
  /// Preset `best`: how the current marker map must be stretched within its plane to become as long
  /// and as wide as the reference's (a hand-held scan is some tenths of a percent too long or
  /// short, rooms are not); symmetric, 1 across the plane, where depth itself gives the scale.
  /// Applied about `centre_m` after T_reference_current, which is the rigid fit.
  Eigen::Matrix3d stretch = Eigen::Matrix3d::Identity();
  double rms_m = 0.0;                      ///< Over the corners used, rigid.
  std::vector<int> markers_used;           ///< Ids, ascending.
  std::map<int, double> markers_rejected;  ///< Id to its residual against the others, metres.
  /// Rotation vector, translation; left perturbation about `centre_m`.
  Matrix6d covariance = Matrix6d::Zero();
  /// Weighted centroid of the corners used, reference frame.
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  double spread_m = 0.0;       ///< RMS distance of the markers used from `centre_m`.
  double stretch_sigma = 0.0;  ///< Standard deviation of an element of `stretch`.
  /// Scatter of the markers' centres about the rigidly aligned ones, m^2: by how much the two maps
  /// disagree at a place.
  Eigen::Matrix3d distortion = Eigen::Matrix3d::Zero();
};

/// Alignment of two marker maps, and what the gates need to know of the markers.
struct AlignmentOutcome {
  std::optional<Alignment> alignment;  ///< None where no pose is determined.
  MarkerEvidence markers;              ///< For RefusalsOfMarkers().
  std::vector<std::string> warnings;   ///< E.g. markers that moved.
};

/// Rigid transform between the corners of the markers (ids) in both maps (paper, eq. of the scene
/// alignment; Horn).
///
/// Both presets look for the largest set of markers that agree, then judge each of the others
/// against it by `options`. Preset `best` aligns by that set, weighted by the markers' sigmas, and
/// gives no alignment from fewer than `min_markers` or where two groups of equal size disagree.
/// Preset `paper` aligns by every corner with equal weight wherever that determines a pose; what
/// `best` would have left out is then in `markers`, so that the gates see it.
[[nodiscard]] AlignmentOutcome AlignScenes(const MarkerMap& reference, const MarkerMap& current,
                                           Preset preset = Preset::kBest,
                                           const MarkerConsensusOptions& options = {},
                                           int min_markers = AcceptanceLimits{}.min_shared_markers);

}  // namespace plumb
