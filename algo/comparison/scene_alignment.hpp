// SPDX-License-Identifier: Apache-2.0
// Aligns the current scene to the reference scene by the markers that both contain.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "algo/base/message.hpp"
#include "algo/base/pose.hpp"
#include "algo/base/units.hpp"
#include "algo/types/marker.hpp"
#include "algo/types/scene.hpp"
#include "algo/verdict/gates.hpp"

namespace plumb {

/// A marker counts as moved if its residual exceeds both `moved_m` and `moved_sigmas` of its own
/// standard deviation, so that noise alone does not flag a marker. The standard deviation is the
/// stated one, scaled by how much the other markers scatter.
struct MarkerConsensusOptions {
  double moved_m = 5 * kMillimetre;
  double moved_sigmas = 3.0;
};

/// Alignment of the current scene to the reference scene by the shared markers.
struct Alignment {
  Pose T_reference_current = Pose::Identity();
  /// Preset `best`: the stretch of the current marker map within its plane that gives it the
  /// reference's length and width (a hand-held scan is some tenths of a percent too long or too
  /// short, while rooms do not change). Symmetric, and 1 normal to the plane, where depth itself
  /// determines the scale. Applied about `centre_m` after T_reference_current, which is the rigid
  /// fit.
  Eigen::Matrix3d stretch = Eigen::Matrix3d::Identity();
  double rms_m = 0.0;  ///< Over the corners used, after the rigid fit; NaN without a fit.
  std::vector<int> markers_used;           ///< Ids, ascending.
  std::map<int, double> markers_rejected;  ///< Residual against the other markers by id, metres.
  /// Rotation vector, translation; left perturbation about `centre_m`.
  Matrix6d covariance = Matrix6d::Zero();
  /// Weighted centroid of the corners used, reference frame.
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  double spread_m = 0.0;       ///< RMS distance of the used markers from `centre_m`.
  double stretch_sigma = 0.0;  ///< Standard deviation of an element of `stretch`.
  /// Scatter of the markers' centres about the rigidly aligned ones, m^2: the disagreement of the
  /// two maps at one place.
  Eigen::Matrix3d distortion = Eigen::Matrix3d::Zero();
};

/// Alignment of two marker maps, and the evidence that the gates need.
struct AlignmentOutcome {
  std::optional<Alignment> alignment;  ///< Not set where the markers do not determine a pose.
  MarkerEvidence markers;              ///< For RefusalsOfMarkers().
  std::vector<Message> warnings;       ///< For example markers that moved.
};

/// Root mean square distance of a marker's corners from where T_to_from places them. Unlike the
/// distance of its centres it sees a marker that was turned in its place.
[[nodiscard]] double CornerDistance(const MarkerCorners& to, const Pose& T_to_from,
                                    const MarkerCorners& from);

/// Rigid transform between the corners of the markers (ids) in both maps (paper, eq. of the scene
/// alignment; Horn).
///
/// Both presets search the largest set of markers that agree and judge each of the others against
/// it by `options`. Preset `best` aligns by that set, weighted by the markers' sigmas, and gives no
/// alignment from fewer than `min_markers` or where two groups of equal size disagree. Preset
/// `paper` aligns by every corner with equal weight wherever that determines a pose. What `best`
/// would have left out is then reported in `markers`, so that the gates see it.
[[nodiscard]] AlignmentOutcome AlignScenes(const MarkerMap& reference, const MarkerMap& current,
                                           Preset preset = Preset::kBest,
                                           const MarkerConsensusOptions& options = {},
                                           int min_markers = AcceptanceLimits{}.min_shared_markers);

}  // namespace plumb
