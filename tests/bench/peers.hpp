// SPDX-License-Identifier: Apache-2.0
// How plumb_bench_peers calls other libraries: one row of its table for each method.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "algo/base/pose.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Everything that a peer is given of a keyframe.
struct PeerView {
  PointCloud cloud_in_camera;              ///< Every valid pixel, undistorted by the stated lens.
  Pose T_world_camera = Pose::Identity();  ///< As tracked: the start of the registration.
};

struct PeerMethod {
  std::string name;
  std::string parameters;  ///< For the table's caption.
  /// Returns T_world_camera for each view. The first view may move, too.
  std::function<std::vector<Pose>(std::span<const PeerView>)> solve;
};

/// Both libraries' tutorials use these values for clouds that are nearly aligned.
inline constexpr double kPeerVoxel_m = 0.02;
inline constexpr double kPeerMaxDistance_m = 0.03;  ///< Between corresponding points.

[[nodiscard]] PeerMethod Open3dMethod();
[[nodiscard]] PeerMethod PclMethod();

}  // namespace plumb
