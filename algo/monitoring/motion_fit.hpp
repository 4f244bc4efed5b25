// SPDX-License-Identifier: Apache-2.0
// The rigid motion of a surface, and its breathing, from one frame of each sensor at rest.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "algo/base/pose.hpp"
#include "algo/monitoring/block_image.hpp"
#include "algo/monitoring/view_model.hpp"

namespace plumb {

/// One sensor's part of a fit; borrowed for the call.
struct FitView {
  const BlockGrid& grid;
  const ViewModel& model;
  const BlockImage& image;
  Pose T_scene_camera = Pose::Identity();
  /// Factor of the image's inverse depth by block: what the sensor is known to measure wrong there.
  const std::vector<float>* correction = nullptr;
  double drift = 1.0;  ///< Another one, of all blocks.
  /// Rise along the normal by block for each metre of the breathing's two patterns; null: there is
  /// no such pattern.
  std::array<const std::vector<float>*, 2> modes = {};
  Eigen::Vector2d modes_of_model_m = Eigen::Vector2d::Zero();  ///< At which the model was made.
  Eigen::Vector2d modes_m = Eigen::Vector2d::Zero();           ///< Where the fit starts.
  /// Standard deviations assumed of the two patterns, about 0.
  Eigen::Vector2d mode_sigmas_m = Eigen::Vector2d::Constant(0.02);
};

/// What a block measured, scene frame; nothing where it measured nothing.
[[nodiscard]] std::optional<Eigen::Vector3d> MeasuredPoint(const FitView& view, std::size_t block);

/// What one sensor contributed to a fit.
struct ViewFit {
  Eigen::Vector2d modes_m = Eigen::Vector2d::Zero();  ///< Each sensor has its own two patterns.
  int num_used = 0;                                   ///< Blocks within the gate.
  double num_expected = 0;                            ///< Blocks of the region in the model.
  double residual = 0.0;  ///< Median of |residual| / sigma over the blocks used.

  [[nodiscard]] double visible() const { return num_expected > 0 ? num_used / num_expected : 0; }
};

/// p_now = T p_model for the points of the region, in the scene frame, apart from the breathing.
struct MotionFit {
  Pose T = Pose::Identity();
  std::vector<ViewFit> views = {};  ///< In the order of the sensors.
  /// Of the rotation vector (rad) and translation (m), left perturbation about the moved centroid,
  /// whatever the patterns' sizes are; with the sensors' stated noise, as if all blocks were
  /// independent.
  Matrix6d information = Matrix6d::Zero();
  bool converged = false;

  /// Of the blocks of all sensors.
  [[nodiscard]] double visible() const;
};

struct FitStart {
  Pose T = Pose::Identity();
  double gate_m = 0.04;  ///< Of the first iteration; it shrinks to 8 mm.
};

/// Projective point-to-plane by Gauss-Newton with Huber weights: each block of the image against
/// the plane of the block to which the motion moves it back. Only blocks of the region take part.
/// The normal equations of the sensors are summed, each without its own breathing.
/// Nothing is parallel; the same input gives the same bits.
/// @param centroid  Of the region, scene frame.
[[nodiscard]] MotionFit FitMotion(std::span<const FitView> views, const Eigen::Vector3d& centroid,
                                  const FitStart& start);

}  // namespace plumb
