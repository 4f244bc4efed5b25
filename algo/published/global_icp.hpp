// SPDX-License-Identifier: Apache-2.0
// The paper's Global ICP (Algorithm 1): all keyframe clouds registered against each other at once.
#pragma once

#include <functional>
#include <span>
#include <stop_token>
#include <vector>

#include "algo/base/pose.hpp"
#include "algo/base/units.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Parameters of RefinePoses(); defaults are those of the paper. Lengths in metres.
struct GlobalIcpOptions {
  int num_iterations = 20;              ///< N_I: fixed number, no early exit; >= 1.
  double max_radius = 5 * kCentimetre;  ///< r_max: search radius of the first iteration.
  double min_radius =
      0.5 * kCentimetre;  ///< r_min: radius approached by the last one (paper, Alg. 1); > 0.
  double subsample_spacing =
      2 * kCentimetre;  ///< sigma: Poisson-disk spacing; 0 keeps every point.
  unsigned seed = 1;    ///< Seed of the random subsampling.
};

/// The result of one call of RefinePoses(), for logs, benchmarks and the result page.
struct GlobalIcpResult {
  /// Correction of each cloud in the world frame, in input order. The refined
  /// pose of keyframe j is T_refined_world[j] * T_world_camera[j].
  std::vector<Pose> T_refined_world;
  std::vector<double>
      rms_per_iteration;   ///< Point-to-point residual before the motion of each iteration, metres.
  bool cancelled = false;  ///< Stopped early: poses are those of the last whole iteration.
};

/// Registers all clouds against each other at once ("Global ICP", paper Alg. 1).
///
/// Each point is paired with its nearest neighbour in any *other* cloud within the current radius;
/// then each cloud moves by the rigid fit of its own pairs (all clouds at once: Jacobi). A cloud
/// whose pairs do not determine a rigid fit (fewer than three, or on a line) keeps its pose in that
/// iteration. The radius shrinks linearly after use, as published: the last pass runs at min_radius
/// + (max_radius - min_radius) / num_iterations. Only relative poses are determined: all clouds may
/// drift together.
///
/// @param clouds_in_world  One cloud per keyframe, already placed by tracking; metres. Borrowed for
///         the call.
/// @param stop      Polled once per cloud and iteration.
/// @param progress  If set, called on the calling thread after each iteration with the completed
///         fraction in (0, 1].
/// @throws std::invalid_argument if an option is out of range, or a cloud is empty or has points
///         that are not finite; the message names the cause.
///
/// Thread-safe and deterministic: same input and seed, same result, bit for bit, on any number of
/// threads.
[[nodiscard]] GlobalIcpResult RefinePoses(
    std::span<const PointCloud> clouds_in_world, const GlobalIcpOptions& options = {},
    const std::stop_token& stop = {}, const std::function<void(double fraction)>& progress = {});

}  // namespace plumb
