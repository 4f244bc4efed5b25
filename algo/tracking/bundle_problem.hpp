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
/// markers, calibration; landmarks are eliminated. Keeps references to its inputs. Only Write()
/// modifies anything, namely the map and the calibration; the other members may be called from any
/// thread.
class Problem {
 public:
  using TermVector = Eigen::Matrix<double, QuadraticTerm::kSize, 1>;
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

  [[nodiscard]] double PixelWeight() const;
  /// Time from the colour image's stamp to the depth reading at a row.
  [[nodiscard]] double DepthDelay(const State& state, int keyframe, double row_fraction) const;
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
  std::vector<PointView> views;
  std::vector<CornerView> corners;
  // Indices into `views` and `corners`.
  std::vector<Indices> views_of_landmark;
  std::vector<Indices> views_of_keyframe;
  std::vector<Indices> corners_of_keyframe;
  std::vector<Indices> corners_of_marker;
  // First unknowns of their kind, and the number of all.
  Eigen::Index markers_at = 0;
  Eigen::Index calibration_at = 0;
  Eigen::Index size = 0;

 private:
  void CollectMarkers();
  void CollectPoints();
  void DropViewsBehindCameras();
  [[nodiscard]] double PointCost(const State& state, const PointView& view) const;
  [[nodiscard]] double CornerCost(const State& state, const CornerView& view) const;
  [[nodiscard]] Eigen::Vector3d CornerInWorld(const State& state, const CornerView& view) const;

  TrackingMap& map_;
  CalibrationModel& calibration_;
  std::vector<Pose> T_world_marker0_;
};

}  // namespace plumb::bundle
