#include "algo/tracking/local_bundle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include <Eigen/Cholesky>

#include "algo/base/pose.hpp"
#include "algo/base/robust_weights.hpp"
#include "algo/tracking/bundle_model.hpp"

namespace plumb {
namespace {

using Matrix6x3d = Eigen::Matrix<double, 6, 3>;

using bundle::kCornerLossScale;
using bundle::kKeypointLossScale;
using bundle::kNearestPoint_m;

// A keypoint's observation with what the residuals use. Grouped by landmark.
struct PointView {
  int keyframe = 0;       // Index in the map.
  Eigen::Vector2d ideal;  // Undistorted.
  double z_m = 0;         // 0 without depth.
  double weight_z = 0;    // 1 / standard deviation.
};

struct CornerView {
  int keyframe = 0;
  int marker = 0;  // Slot of the marker.
  Eigen::Vector3d in_marker;
  Eigen::Vector2d ideal;
  double weight = 0;
};

// d(R(x)^-1 (p - v)) / dx at 0 for the twist x on the camera's side.
Matrix3x6d PoseDerivative(const Eigen::Vector3d& p) {
  Matrix3x6d J;
  J.leftCols<3>() = Skew(p);
  J.rightCols<3>() = -Eigen::Matrix3d::Identity();
  return J;
}

// d(p.xy / p.z) / dp.
Eigen::Matrix<double, 2, 3> ViewDerivative(const Eigen::Vector3d& p) {
  const double iz = 1.0 / p.z();
  Eigen::Matrix<double, 2, 3> J;
  J << iz, 0, -p.x() * iz * iz, 0, iz, -p.y() * iz * iz;
  return J;
}

class LocalBundle {
 public:
  LocalBundle(const Intrinsics& intrinsics, const LocalBundleOptions& options, TrackingMap& map)
      : intrinsics_(intrinsics),
        options_(options),
        map_(map),
        slot_of_keyframe_(map.keyframes.size()) {
    for (const int k : options.free_keyframes)
      slot_of_keyframe_[static_cast<std::size_t>(k)] = num_poses_++;
    const double scale = intrinsics.width / 640.0;
    weight_px_ = intrinsics.fx / (options.keypoint_sigma_px * scale);
    CollectPoints();
    CollectCorners(scale);
  }

  LocalBundleSummary Run() {
    LocalBundleSummary summary;
    summary.num_observations = static_cast<int>(views_.size() + corners_.size());
    if (num_poses_ == 0 || summary.num_observations == 0) return summary;
    State state = Read();
    double cost = Cost(state);
    summary.initial_cost = cost;
    double damping = 1e-4;
    for (int i = 0; i < options_.max_iterations; ++i) {
      ++summary.num_iterations;
      State next;
      const bool solved = Step(state, damping, next);
      const double next_cost = solved ? Cost(next) : std::numeric_limits<double>::infinity();
      if (!(next_cost < cost)) {
        damping *= 10.0;
        continue;
      }
      const bool last = cost - next_cost < options_.min_relative_decrease * cost;
      state = std::move(next);
      cost = next_cost;
      damping = std::max(1e-7, damping * 0.1);
      if (last) break;
    }
    summary.final_cost = cost;
    if (cost < summary.initial_cost) Write(state);
    return summary;
  }

 private:
  struct State {
    std::vector<Pose> T_camera_world;  // One per keyframe; fixed ones never change.
    std::vector<Pose> T_world_marker;  // One per slot.
    std::vector<Eigen::Vector3d> landmarks;
  };

  void CollectPoints() {
    std::vector<std::optional<int>> slot(map_.landmarks.size());
    for (const int k : options_.free_keyframes) {
      for (const KeypointObservation& o : map_.keyframe(k).keypoints) {
        const Landmark& landmark = map_.landmark(o.landmark);
        std::optional<int>& s = slot[static_cast<std::size_t>(o.landmark)];
        // A landmark with only one observation constrains nothing.
        if (s || !landmark.usable || landmark.num_observations < 2) continue;
        s = static_cast<int>(landmarks_.size());
        landmarks_.push_back(o.landmark);
      }
    }
    first_view_.assign(landmarks_.size() + 1, 0);
    const auto for_each = [&](const auto& visit) {
      for (std::size_t k = 0; k < map_.keyframes.size(); ++k)
        for (const KeypointObservation& o : map_.keyframes[k].keypoints)
          if (const std::optional<int> s = slot[static_cast<std::size_t>(o.landmark)])
            visit(static_cast<int>(k), static_cast<std::size_t>(*s), o);
    };
    for_each([&](int, std::size_t s, const KeypointObservation&) { ++first_view_[s + 1]; });
    for (std::size_t s = 0; s < landmarks_.size(); ++s) first_view_[s + 1] += first_view_[s];
    views_.resize(first_view_.back());
    std::vector<std::size_t> next(first_view_.begin(), first_view_.end() - 1);
    for_each([&](int k, std::size_t s, const KeypointObservation& o) {
      PointView& view = views_[next[s]++];
      view = {k, Undistort(intrinsics_, o.pixel), o.z_m, 0.0};
      if (o.z_m > 0)
        view.weight_z =
            1.0 / (options_.keypoint_depth_sigmas * DepthSigma(options_.depth_noise, o.z_m, 0.8));
    });
  }

  void CollectCorners(double scale) {
    std::map<int, int> slots;
    for (const int k : options_.free_keyframes)
      for (const MarkerObservation& m : map_.keyframe(k).data.markers)
        if (map_.markers.contains(m.id)) slots.try_emplace(m.id, 0);
    for (auto& [id, slot] : slots) {
      slot = static_cast<int>(markers_.size());
      markers_.push_back(id);
    }
    const MarkerCorners in_marker = CornersInMarkerFrame(options_.marker_length_m);
    for (std::size_t k = 0; k < map_.keyframes.size(); ++k) {
      for (const MarkerObservation& m : map_.keyframes[k].data.markers) {
        const auto found = slots.find(m.id);
        if (found == slots.end()) continue;
        for (std::size_t i = 0; i < 4; ++i)
          corners_.push_back(
              {static_cast<int>(k), found->second, in_marker[i],
               Undistort(intrinsics_, m.corners[i]),
               intrinsics_.fx / std::max(options_.min_corner_sigma_px * scale, m.sigma_px[i])});
      }
    }
  }

  [[nodiscard]] State Read() const {
    State state;
    for (const MapKeyframe& keyframe : map_.keyframes)
      state.T_camera_world.push_back(keyframe.T_world_color.inverse());
    for (const int id : markers_)
      state.T_world_marker.push_back(map_.markers.at(id).T_world_marker);
    for (const int id : landmarks_) state.landmarks.push_back(map_.landmark(id).p_world);
    return state;
  }

  void Write(const State& state) {
    for (const int k : options_.free_keyframes)
      map_.keyframe(k).T_world_color =
          Orthonormalised(state.T_camera_world[static_cast<std::size_t>(k)].inverse());
    for (std::size_t s = 0; s < markers_.size(); ++s)
      map_.markers.at(markers_[s]).T_world_marker = Orthonormalised(state.T_world_marker[s]);
    for (std::size_t s = 0; s < landmarks_.size(); ++s)
      map_.landmark(landmarks_[s]).p_world = state.landmarks[s];
  }

  // Depth of a point in the camera at its depth stamp, `dt` after the colour stamp: row 2 of p - dt
  // (w x p + v).
  [[nodiscard]] double DepthAtStamp(const MapKeyframe& keyframe, const Eigen::Vector3d& p) const {
    const double dt_s = keyframe.data.depth_time_s - keyframe.data.color_time_s;
    return p.z() - dt_s * (keyframe.velocity_per_s[0] * p.y() - keyframe.velocity_per_s[1] * p.x() +
                           keyframe.velocity_per_s[5]);
  }

  [[nodiscard]] double Cost(const State& state) const {
    double cost = 0;
    for (std::size_t s = 0; s < landmarks_.size(); ++s) {
      for (std::size_t i = first_view_[s]; i < first_view_[s + 1]; ++i) {
        const PointView& view = views_[i];
        const Eigen::Vector3d p =
            state.T_camera_world[static_cast<std::size_t>(view.keyframe)] * state.landmarks[s];
        if (p.z() < kNearestPoint_m) return std::numeric_limits<double>::infinity();
        const Eigen::Vector2d r = (p.head<2>() / p.z() - view.ideal) * weight_px_;
        cost += CauchyLoss(r.squaredNorm(), kKeypointLossScale);
        if (view.weight_z == 0) continue;
        const double rz =
            (DepthAtStamp(map_.keyframe(view.keyframe), p) - view.z_m) * view.weight_z;
        cost += CauchyLoss(rz * rz, kKeypointLossScale);
      }
    }
    for (const CornerView& view : corners_) {
      const Eigen::Vector3d p =
          state.T_camera_world[static_cast<std::size_t>(view.keyframe)] *
          (state.T_world_marker[static_cast<std::size_t>(view.marker)] * view.in_marker);
      if (p.z() < kNearestPoint_m) return std::numeric_limits<double>::infinity();
      const Eigen::Vector2d r = (p.head<2>() / p.z() - view.ideal) * view.weight;
      cost += CauchyLoss(r.squaredNorm(), kCornerLossScale);
    }
    return cost;
  }

  // Contribution of one landmark: its own 3x3 system and its coupling to each free keyframe that
  // observes it.
  struct PointSystem {
    Eigen::Matrix3d V = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    std::vector<std::pair<int, Matrix6x3d>> W;  // By pose slot.
  };

  // Normal equations of the poses and markers (H, g) and of one landmark.
  void AddLandmark(const State& state, std::size_t s, Eigen::MatrixXd& H, Eigen::VectorXd& g,
                   PointSystem& point) const {
    for (std::size_t i = first_view_[s]; i < first_view_[s + 1]; ++i) {
      const PointView& view = views_[i];
      const Pose& T_camera_world = state.T_camera_world[static_cast<std::size_t>(view.keyframe)];
      const Eigen::Vector3d p = T_camera_world * state.landmarks[s];
      Eigen::Vector3d r;
      Eigen::Matrix3d J_camera;  // d(residuals) / dp
      r.head<2>() = (p.head<2>() / p.z() - view.ideal) * weight_px_;
      const double weight = std::sqrt(CauchyWeight(r.head<2>().squaredNorm(), kKeypointLossScale));
      r.head<2>() *= weight;
      J_camera.topRows<2>() = weight * weight_px_ * ViewDerivative(p);
      r.z() = 0;
      J_camera.row(2).setZero();
      if (view.weight_z > 0) {
        const MapKeyframe& keyframe = map_.keyframe(view.keyframe);
        const double rz = (DepthAtStamp(keyframe, p) - view.z_m) * view.weight_z;
        const double weight_z = std::sqrt(CauchyWeight(rz * rz, kKeypointLossScale));
        const double dt_s = keyframe.data.depth_time_s - keyframe.data.color_time_s;
        r.z() = weight_z * rz;
        J_camera.row(2) = weight_z * view.weight_z *
                          Eigen::RowVector3d(dt_s * keyframe.velocity_per_s[1],
                                             -dt_s * keyframe.velocity_per_s[0], 1.0);
      }
      const Eigen::Matrix3d J_point = J_camera * T_camera_world.linear();
      point.V.noalias() += J_point.transpose() * J_point;
      point.g.noalias() += J_point.transpose() * r;
      const std::optional<int> slot = slot_of_keyframe_[static_cast<std::size_t>(view.keyframe)];
      if (!slot) continue;
      const Matrix3x6d J_pose = J_camera * PoseDerivative(p);
      H.block<6, 6>(6 * *slot, 6 * *slot).noalias() += J_pose.transpose() * J_pose;
      g.segment<6>(6 * *slot).noalias() += J_pose.transpose() * r;
      point.W.emplace_back(*slot, J_pose.transpose() * J_point);
    }
  }

  void AddCorner(const State& state, const CornerView& view, Eigen::MatrixXd& H,
                 Eigen::VectorXd& g) const {
    const Pose& T_camera_world = state.T_camera_world[static_cast<std::size_t>(view.keyframe)];
    const Pose& T_world_marker = state.T_world_marker[static_cast<std::size_t>(view.marker)];
    const Eigen::Vector3d p = T_camera_world * (T_world_marker * view.in_marker);
    Eigen::Vector2d r = (p.head<2>() / p.z() - view.ideal) * view.weight;
    const double weight = std::sqrt(CauchyWeight(r.squaredNorm(), kCornerLossScale));
    r *= weight;
    const Eigen::Matrix<double, 2, 3> J = weight * view.weight * ViewDerivative(p);
    // The twist on the marker's side: p_world = T_world_marker (p + w x p + v).
    const Matrix3x6d J_in_marker = PointJacobian(view.in_marker);
    const Eigen::Matrix<double, 2, 6> J_marker =
        J * (T_camera_world.linear() * T_world_marker.linear()) * J_in_marker;
    const int m = 6 * (num_poses_ + view.marker);
    H.block<6, 6>(m, m).noalias() += J_marker.transpose() * J_marker;
    g.segment<6>(m).noalias() += J_marker.transpose() * r;
    const std::optional<int> slot = slot_of_keyframe_[static_cast<std::size_t>(view.keyframe)];
    if (!slot) return;
    const Eigen::Matrix<double, 2, 6> J_pose = J * PoseDerivative(p);
    H.block<6, 6>(6 * *slot, 6 * *slot).noalias() += J_pose.transpose() * J_pose;
    H.block<6, 6>(m, 6 * *slot).noalias() += J_marker.transpose() * J_pose;
    g.segment<6>(6 * *slot).noalias() += J_pose.transpose() * r;
  }

  // One damped Gauss-Newton step from `state` to `next`; only the lower half of H is used. False if
  // the system cannot be solved.
  bool Step(const State& state, double damping, State& next) const {
    const int size = 6 * (num_poses_ + static_cast<int>(markers_.size()));
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(size);
    for (const CornerView& view : corners_) AddCorner(state, view, H, g);
    std::vector<PointSystem> points(landmarks_.size());
    for (std::size_t s = 0; s < landmarks_.size(); ++s) AddLandmark(state, s, H, g, points[s]);
    H.diagonal() *= 1.0 + damping;
    H.diagonal().array() += 1e-9;
    for (PointSystem& point : points) {
      point.V.diagonal() *= 1.0 + damping;
      point.V.diagonal().array() += 1e-9;
      point.V = point.V.inverse().eval();
      for (const auto& [a, W_a] : point.W) {
        const Matrix6x3d WV = W_a * point.V;
        g.segment<6>(6 * a).noalias() -= WV * point.g;
        for (const auto& [b, W_b] : point.W)
          if (b <= a) H.block<6, 6>(6 * a, 6 * b).noalias() -= WV * W_b.transpose();
      }
    }
    const Eigen::LDLT<Eigen::MatrixXd, Eigen::Lower> solver(H);
    if (solver.info() != Eigen::Success) return false;
    const Eigen::VectorXd x = -solver.solve(g);
    if (!x.allFinite()) return false;
    next = state;
    for (const int k : options_.free_keyframes) {
      const auto index = static_cast<std::size_t>(k);
      next.T_camera_world[index] =
          PoseFromTwist(x.segment<6>(6 * slot_of_keyframe_[index].value())).inverse() *
          state.T_camera_world[index];
    }
    for (std::size_t s = 0; s < markers_.size(); ++s)
      next.T_world_marker[s] = state.T_world_marker[s] *
                               PoseFromTwist(x.segment<6>(6 * (num_poses_ + static_cast<int>(s))));
    for (std::size_t s = 0; s < landmarks_.size(); ++s) {
      Eigen::Vector3d right = points[s].g;
      for (const auto& [a, W_a] : points[s].W)
        right.noalias() += W_a.transpose() * x.segment<6>(6 * a);
      next.landmarks[s] -= points[s].V * right;
    }
    return true;
  }

  const Intrinsics& intrinsics_;
  const LocalBundleOptions& options_;
  TrackingMap& map_;
  int num_poses_ = 0;
  std::vector<std::optional<int>> slot_of_keyframe_;  // A fixed keyframe has none.
  double weight_px_ = 0;        // Focal length over the standard deviation of a keypoint.
  std::vector<int> landmarks_;  // Ids in the map.
  std::vector<int> markers_;
  std::vector<std::size_t> first_view_;  // First entry of each landmark in `views_`, plus the end.
  std::vector<PointView> views_;
  std::vector<CornerView> corners_;
};

}  // namespace

LocalBundleSummary AdjustLocalMap(const Intrinsics& intrinsics, const LocalBundleOptions& options,
                                  TrackingMap& map) {
  return LocalBundle(intrinsics, options, map).Run();
}

}  // namespace plumb
