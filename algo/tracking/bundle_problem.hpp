// The observations, the unknowns and the cost of one bundle adjustment.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "algo/tracking/bundle_adjustment.hpp"
#include "algo/tracking/bundle_model.hpp"

namespace plumb::bundle {

inline constexpr int kCamera = 6;  ///< Unknowns of a keyframe: its twist.

/// An observation of a keypoint.
struct PointView {
  int keyframe = 0;
  int landmark = 0;  ///< Slot of the landmark.
  Eigen::Vector2d pixel;
  DepthPlace place;
  DepthReading depth;
  double weight_z = 0;
};

struct CornerView {
  int keyframe = 0;
  int marker = 0;  ///< Slot of the marker.
  Eigen::Vector3d in_marker;
  Eigen::Vector2d pixel;
  /// Sum of the unit directions along the two sides that meet at this corner, times the pixel
  /// scale.
  Eigen::Vector2d inward;
  double weight = 0;
};

/// Values of all unknowns.
struct State {
  std::vector<CameraState> cameras;  ///< One per keyframe of the map; fixed ones never change.
  std::vector<Vector6d> markers;     ///< Twists on the markers' side.
  std::vector<Eigen::Vector3d> landmarks;
  CalibrationModel calibration;
};

/// One problem, which lives for one call of BundleAdjust(). Order of the unknowns: free poses,
/// markers, calibration; landmarks are eliminated. Keeps references to its inputs. Only
/// DropViewsBehindCameras() and Write() modify anything; the other members may be called from any
/// thread.
class Problem {
 public:
  using TermVector = Eigen::Matrix<double, QuadraticTerm::kSize, 1>;

  Problem(const Intrinsics& stated, const BundleOptions& options,
          const std::vector<QuadraticTerm>& terms, TrackingMap& map, CalibrationModel& calibration);

  [[nodiscard]] State Start() const;
  /// Drops observations of landmarks that start behind a camera, where they have no projection.
  /// Cost() keeps the others in front.
  void DropViewsBehindCameras(const State& state);
  /// 1/2 sum of losses plus the quadratic terms (up to their constant); infinite where a point is
  /// behind its camera.
  [[nodiscard]] double Cost(const State& state) const;
  /// Writes the state into the map and the calibration.
  void Write(const State& state);

  [[nodiscard]] double PixelWeight() const;
  /// Time from the colour image's stamp to the depth reading at a row.
  [[nodiscard]] double DepthDelay(const State& state, int keyframe, double row_share) const;
  /// Offset from a keypoint's pixel to where the depth image shows it.
  /// @param pixel_velocity  Of the point in the image, pixels per second.
  /// @param later_s  Time by which the depth is read later.
  [[nodiscard]] Eigen::Vector2d DepthOffset(const State& state,
                                            const Eigen::Vector2d& pixel_velocity,
                                            double later_s) const;
  [[nodiscard]] Eigen::Vector2d CornerResidual(const State& state, const CornerView& view,
                                               const Eigen::Vector3d& p) const;
  [[nodiscard]] TermVector TermState(const State& state, const QuadraticTerm& term) const;
  /// The state at the beginning.
  [[nodiscard]] const Pose& MarkerPose(int slot) const;
  [[nodiscard]] int MarkerSlot(int id) const { return markers_.at(id); }
  /// First unknown of a keyframe, unless it is fixed.
  [[nodiscard]] std::optional<Eigen::Index> CameraAt(int keyframe) const;
  [[nodiscard]] Eigen::Index MarkerAt(int slot) const { return markers_at_ + 6 * slot; }
  [[nodiscard]] Eigen::Index calibration_at() const { return calibration_at_; }
  [[nodiscard]] Eigen::Index size() const { return size_; }

  [[nodiscard]] const Intrinsics& stated() const { return stated_; }
  [[nodiscard]] const BundleOptions& options() const { return options_; }
  [[nodiscard]] const std::vector<QuadraticTerm>& terms() const { return terms_; }
  [[nodiscard]] const std::vector<PointView>& views() const { return views_; }
  [[nodiscard]] const std::vector<CornerView>& corners() const { return corners_; }
  /// Free keyframes, by pose slot.
  [[nodiscard]] const std::vector<int>& free() const { return free_; }
  /// Place of a keyframe in free(), unless it is fixed.
  [[nodiscard]] std::optional<int> PoseSlot(int keyframe) const {
    return pose_slot_[static_cast<std::size_t>(keyframe)];
  }
  [[nodiscard]] std::size_t num_keyframes() const { return pose_slot_.size(); }
  [[nodiscard]] const std::map<int, int>& marker_slots() const { return markers_; }
  [[nodiscard]] std::size_t num_markers() const { return markers_.size(); }
  [[nodiscard]] std::size_t num_landmarks() const { return landmarks_.size(); }
  /// Indices into views().
  [[nodiscard]] const std::vector<std::uint32_t>& ViewsOfLandmark(std::size_t slot) const {
    return views_of_landmark_[slot];
  }
  [[nodiscard]] const std::vector<std::uint32_t>& ViewsOfKeyframe(std::size_t keyframe) const {
    return views_of_keyframe_[keyframe];
  }
  /// Indices into corners().
  [[nodiscard]] const std::vector<std::uint32_t>& CornersOfKeyframe(std::size_t keyframe) const {
    return corners_of_keyframe_[keyframe];
  }
  [[nodiscard]] const std::vector<std::uint32_t>& CornersOfMarker(std::size_t slot) const {
    return corners_of_marker_[slot];
  }

 private:
  void CollectMarkers();
  void CollectPoints();
  [[nodiscard]] double PointCost(const State& state, const PointView& view) const;
  [[nodiscard]] double CornerCost(const State& state, const CornerView& view) const;
  [[nodiscard]] Eigen::Vector3d CornerInWorld(const State& state, const CornerView& view) const;

  const Intrinsics& stated_;
  const BundleOptions& options_;
  const std::vector<QuadraticTerm>& terms_;
  TrackingMap& map_;
  CalibrationModel& calibration_;
  std::vector<int> free_;
  std::vector<std::optional<int>> pose_slot_;  // Per keyframe.
  std::map<int, int> markers_;                 // From id to slot.
  std::vector<Pose> T_world_marker0_;
  std::vector<int> landmarks_;  // Ids by slot.
  std::vector<PointView> views_;
  std::vector<CornerView> corners_;
  std::vector<std::vector<std::uint32_t>> views_of_landmark_;
  std::vector<std::vector<std::uint32_t>> views_of_keyframe_;
  std::vector<std::vector<std::uint32_t>> corners_of_keyframe_;
  std::vector<std::vector<std::uint32_t>> corners_of_marker_;
  Eigen::Index markers_at_ = 0;
  Eigen::Index calibration_at_ = 0;
  Eigen::Index size_ = 0;
};

}  // namespace plumb::bundle
