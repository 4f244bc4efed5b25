// How plumb_bench_peers calls other libraries: one row of its table for each method.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "algo/base/pose.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// All that a peer gets of a keyframe.
struct PeerView {
  PointCloud cloud_in_camera;              ///< Every valid pixel, the stated lens undone.
  Pose T_world_camera = Pose::Identity();  ///< As tracked: the start of the registration.
};

struct PeerMethod {
  std::string name;
  std::string parameters;  ///< For the table's caption.
  /// New T_world_camera, one a view; the first view's may move, too.
  std::function<std::vector<Pose>(std::span<const PeerView>)> solve;
};

/// As in the tutorials of both libraries for clouds that are nearly aligned.
inline constexpr double kPeerVoxel_m = 0.02;
inline constexpr double kPeerMaxDistance_m = 0.03;  ///< Of two points that correspond.

[[nodiscard]] PeerMethod Open3dMethod();
[[nodiscard]] PeerMethod PclMethod();

}  // namespace plumb
