// SPDX-License-Identifier: Apache-2.0
// Estimates one frame's pose robustly from keypoints, marker corners and depth together.
#pragma once

#include <vector>

#include "algo/base/pose.hpp"
#include "algo/map/dense_view.hpp"
#include "algo/sensor_model/depth_noise.hpp"

namespace plumb {

/// A known point observed in the frame.
struct PosePoint {
  Eigen::Vector3d p_world;
  Eigen::Vector2d ideal;   ///< Ideal normalised coordinates of the observation.
  double sigma = 0.001;    ///< Standard deviation of `ideal` (pixels / focal length).
  double inverse_z = 0.0;  ///< 1 / measured depth; 0 without depth.
  double inverse_z_sigma = 0.01;
};

/// Input of one pose. The dense part is optional: point-to-plane distances between the frame's
/// depth and a keyframe's, by projective association.
struct PoseProblem {
  std::vector<PosePoint> points;
  const DenseView* dense_frame = nullptr;
  const DenseView* dense_target = nullptr;
  Pose T_world_target = Pose::Identity();  ///< Pose of the target's depth camera.
  Pose T_color_depth =
      Pose::Identity();  ///< Motion from the frame's colour stamp to its depth stamp.
  /// Camera of the full image; the cells of the dense views are scaled from it.
  Intrinsics intrinsics;
  DepthNoise depth_noise = {};  ///< Of both dense views; the sensor's, see StreamInfo.
  int num_iterations = 10;
};

struct PoseEstimate {
  Pose T_world_camera = Pose::Identity();  ///< At the colour stamp.
  std::vector<bool> inlier;                ///< One per point.
  int num_inliers = 0;
  int num_dense = 0;  ///< Dense cells associated in the last iteration.
  double dense_overlap =
      0.0;  ///< Fraction of the frame's valid cells that were associated within the gate.
  double dense_rms_m = 0.0;
  Matrix6d information =
      Matrix6d::Zero();  ///< Of the twist (rotation, translation) in the camera frame.
  bool converged = false;
};

/// Gauss-Newton with Geman-McClure-like reweighting, starting at `T_world_camera_start`.
/// Deterministic and thread-safe.
[[nodiscard]] PoseEstimate OptimizePose(const PoseProblem& problem,
                                        const Pose& T_world_camera_start);

}  // namespace plumb
