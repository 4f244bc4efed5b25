// SPDX-License-Identifier: Apache-2.0
// The observations, the unknowns and the cost of one bundle adjustment.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "algo/bundle/bundle_model.hpp"
#include "algo/bundle/bundle_options.hpp"
#include "algo/bundle/corner_term.hpp"
#include "algo/bundle/keypoint_term.hpp"
#include "algo/bundle/quadratic_term.hpp"
#include "algo/map/map.hpp"

namespace plumb::bundle {

/// Values of all unknowns.
struct State {
  std::vector<CameraState> cameras;  ///< One per keyframe of the map; fixed ones never change.
  std::vector<Vector6d> markers;     ///< Twists on the markers' side.
  std::vector<Eigen::Vector3d> landmarks;
  CalibrationModel calibration;
};

/// One problem, which lives for one call of BundleAdjust(). Order of the unknowns: free poses,
/// markers, calibration; landmarks are eliminated. Keeps references to its inputs. Only Write()
/// modifies anything, namely the map and the calibration; the other members may be called from any
/// thread.
class Problem {
 public:
  using Indices = std::vector<std::uint32_t>;

  /// Leaves out observations of points that start behind a camera, where they have no projection.
  /// Cost() keeps the others in front.
  Problem(const Intrinsics& stated_camera, const BundleOptions& bundle_options,
          const std::vector<QuadraticTerm>& quadratic_terms, TrackingMap& map,
          CalibrationModel& calibration);

  [[nodiscard]] State Start() const;
  /// 1/2 sum of losses plus the quadratic terms (up to their constant); infinite where a point is
  /// behind its camera.
  [[nodiscard]] double Cost(const State& state) const;
  /// Writes the state into the map and the calibration.
  void Write(const State& state) const;

  // The terms at a state.
  [[nodiscard]] KeypointTerm::Rows Linearise(const State& state, const KeypointTerm& term) const;
  [[nodiscard]] CornerTerm::Rows Linearise(const State& state, const CornerTerm& term) const;
  [[nodiscard]] QuadraticTerm::Vector TermState(const State& state,
                                                const QuadraticTerm& term) const;
  /// The state at the beginning.
  [[nodiscard]] const Pose& MarkerPose(int slot) const;
  /// Place of a keyframe among the free ones, unless it is fixed.
  [[nodiscard]] std::optional<int> PoseSlot(int keyframe) const {
    return pose_slots[static_cast<std::size_t>(keyframe)];
  }
  /// First unknown of a keyframe, unless it is fixed.
  [[nodiscard]] std::optional<Eigen::Index> CameraAt(int keyframe) const;
  [[nodiscard]] Eigen::Index MarkerAt(int slot) const { return markers_at + 6 * slot; }

  const Intrinsics& stated;
  const BundleOptions& options;
  const std::vector<QuadraticTerm>& terms;
  std::vector<int> free;                       ///< Free keyframes, by pose slot.
  std::vector<std::optional<int>> pose_slots;  ///< One per keyframe of the map.
  std::map<int, int> markers;                  ///< From id to slot.
  std::vector<int> landmarks;                  ///< Ids by slot.
  std::vector<KeypointTerm> keypoints;
  std::vector<CornerTerm> corners;
  // Indices into `keypoints` and `corners`.
  std::vector<Indices> keypoints_of_landmark;
  std::vector<Indices> keypoints_of_keyframe;
  std::vector<Indices> corners_of_keyframe;
  std::vector<Indices> corners_of_marker;
  // First unknowns of their kind, and the number of all.
  Eigen::Index markers_at = 0;
  Eigen::Index calibration_at = 0;
  Eigen::Index size = 0;

 private:
  void CollectMarkers();
  void CollectKeypoints();
  void DropTermsBehindCameras();
  [[nodiscard]] double Cost(const State& state, const KeypointTerm& term) const;
  [[nodiscard]] double Cost(const State& state, const CornerTerm& term) const;
  [[nodiscard]] MarkerState StateOf(const State& state, const CornerTerm& term) const;

  TrackingMap& map_;
  CalibrationModel& calibration_;
  std::vector<Pose> T_world_marker0_;
};

}  // namespace plumb::bundle
