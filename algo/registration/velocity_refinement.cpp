// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/velocity_refinement.hpp"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>
#include <Eigen/Cholesky>

#include "algo/bundle/witnesses.hpp"
#include "algo/registration/row_motion_term.hpp"

namespace plumb {
namespace {

using namespace bundle;  // NOLINT: the residuals' own vocabulary
using Vector12d = Eigen::Matrix<double, 12, 1>;
using Matrix12d = Eigen::Matrix<double, 12, 12>;

constexpr int kVelocityIterations = 4;
// With fewer points, pose and velocity would depend on the prior only.
constexpr int kMinPoints = 12;

// One keyframe's equations for its twist and the change of its velocity.
class ImageMotion {
 public:
  ImageMotion(const Intrinsics& stated, const CalibrationModel& calibration,
              const VelocityOptions& options, const TrackingMap& map, int keyframe)
      : stated_(stated),
        calibration_(calibration),
        options_(options),
        map_(map),
        keyframe_index_(keyframe),
        keyframe_(map.keyframe(keyframe)) {
    camera_.T_camera0_world = keyframe_.T_world_color.inverse();
    camera_.velocity_per_s = keyframe_.velocity_per_s;
  }

  Vector6d Solve() {
    prior_.tail<6>() << Eigen::Vector3d::Constant(std::pow(options_.turning_sigma_rad_per_s, -2)),
        Eigen::Vector3d::Constant(std::pow(options_.shifting_sigma_m_per_s, -2));
    for (int i = 0; i < kVelocityIterations; ++i) {
      camera_.Prepare();
      H_ = prior_.asDiagonal();
      g_ = prior_.cwiseProduct(change_);
      count_ = 0;
      AddKeypoints();
      AddCorners();
      if (count_ < kMinPoints) return keyframe_.velocity_per_s;
      const Vector12d step = H_.ldlt().solve(g_);
      if (!step.allFinite()) return keyframe_.velocity_per_s;
      camera_.twist -= step.head<6>();
      change_ -= step;
      camera_.velocity_per_s = keyframe_.velocity_per_s + change_.tail<6>();
    }
    return camera_.velocity_per_s;
  }

 private:
  void AddKeypoints() {
    const double weight = 640.0 / (options_.keypoint_sigma_px * stated_.width);
    for (const KeypointObservation& o : keyframe_.keypoints) {
      const Landmark& landmark = map_.landmark(o.landmark);
      if (!landmark.usable || landmark.num_observations < 2) continue;
      if (options_.keep_witnesses_out && IsWitness(landmark, o.landmark)) continue;
      Add({landmark.p_world, o.pixel, Eigen::Vector2d::Zero(), weight, kKeypointLossScale});
    }
  }

  void AddCorners() {
    const MarkerCorners in_marker = CornersInMarkerFrame(options_.marker_length_m);
    const double scale = stated_.width / 640.0;
    for (const MarkerObservation& m : keyframe_.data.markers) {
      const auto found = map_.markers.find(m.id);
      if (found == map_.markers.end()) continue;
      if (options_.keep_witnesses_out && IsWitness(found->second, m.id, keyframe_index_)) continue;
      for (std::size_t i = 0; i < 4; ++i) {
        Add({found->second.T_world_marker * in_marker[i], m.corners[i],
             calibration_.edge_bias_px[0] * scale * Inward(m.corners, i),
             1.0 / std::max(options_.min_corner_sigma_px * scale, m.sigma_px[i]),
             kCornerLossScale});
      }
    }
  }

  void Add(const RowMotionTerm& term) {
    const auto rows = term.Linearise(stated_, calibration_, camera_);
    if (!rows) return;
    H_.noalias() += rows->J.transpose() * rows->J;
    g_.noalias() += rows->J.transpose() * rows->r;
    ++count_;
  }

  const Intrinsics& stated_;
  const CalibrationModel& calibration_;
  const VelocityOptions& options_;
  const TrackingMap& map_;
  int keyframe_index_;
  const MapKeyframe& keyframe_;
  CameraState camera_;
  Vector12d prior_ = Vector12d::Zero();
  Vector12d change_ = Vector12d::Zero();
  Matrix12d H_ = Matrix12d::Zero();
  Vector12d g_ = Vector12d::Zero();
  int count_ = 0;
};

}  // namespace

void RefineVelocities(const Intrinsics& stated, const CalibrationModel& calibration,
                      const VelocityOptions& options, TrackingMap& map) {
  tbb::parallel_for(std::size_t{0}, map.keyframes.size(), [&](std::size_t k) {
    map.keyframes[k].velocity_per_s =
        ImageMotion(stated, calibration, options, map, static_cast<int>(k)).Solve();
  });
}

}  // namespace plumb
