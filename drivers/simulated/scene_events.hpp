// What moves in the room while a sweep goes on: a pushed marker, a cable, a hand, a breath.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "drivers/simulated/world.hpp"

namespace plumb::simulated {

/// A marker that is pushed over the support. Times since the sweep's start.
struct PushedBoard {
  std::size_t board = 0;
  Pose T_world_after = Pose::Identity();  ///< Of the marker.
  double begin_s = 0.0;
  double end_s = 0.0;
};

/// An arm that comes from one side of the room, stays over a place, and goes back the same way.
struct HandVisit {
  Eigen::Vector3d over = Eigen::Vector3d::Zero();  ///< Where the fingers' tips get, world.
  double side = 1.0;                               ///< Comes from +y or -y.
  double begin_s = 0.0;
  double end_s = 0.0;
};

/// Chest and belly, from breathed out to breathed in.
struct Breath {
  std::vector<std::shared_ptr<const DistanceGrid>> levels;
  double period_s = 4.0;
  double phase = 0.0;
  /// 0: breathed out, 1: breathed in.
  [[nodiscard]] double DepthAt(double time_s) const;
};

struct SceneEvents {
  std::optional<PushedBoard> pushed;
  std::optional<HandVisit> hand;
  std::optional<Breath> breath;
  bool cable = false;
  std::uint64_t seed = 1;
  [[nodiscard]] bool Any() const { return pushed || hand || breath || cable; }
};

/// The room at a moment. What moves stands still during an image.
/// @param T_world_camera  Carries the cable.
[[nodiscard]] World WorldAt(const World& world, const SceneEvents& events, double time_s,
                            const Pose& T_world_camera);

}  // namespace plumb::simulated
