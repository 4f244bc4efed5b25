// Objects that move in the room during a sweep: a pushed marker, a cable, a hand, breathing.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "drivers/simulated/world.hpp"

namespace plumb::simulated {

/// A marker that is pushed across the support. Times since the sweep's start.
struct PushedBoard {
  std::size_t board = 0;
  Pose T_world_after = Pose::Identity();  ///< Pose of the marker afterwards.
  double begin_s = 0.0;
  double end_s = 0.0;
};

/// An arm that reaches into the room from one side, stays over a place, and leaves the same way.
struct HandVisit {
  Eigen::Vector3d over = Eigen::Vector3d::Zero();  ///< Position reached by the fingertips, world.
  double side = 1.0;                               ///< Side from which it comes, +y or -y.
  double begin_s = 0.0;
  double end_s = 0.0;
};

/// Chest and belly, from exhaled to inhaled.
struct Breath {
  std::vector<std::shared_ptr<const DistanceGrid>> levels;
  double chest_m = 0.0;  ///< Rise of the chest from exhaled to inhaled.
  double belly_m = 0.0;  ///< The same of the belly.
  double period_s = 4.0;
  double phase = 0.0;
  /// 0: exhaled, 1: inhaled.
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

/// The room at one moment. Moving objects are static during an image.
/// @param T_world_camera  Carries the cable.
[[nodiscard]] World WorldAt(const World& world, const SceneEvents& events, double time_s,
                            const Pose& T_world_camera);

}  // namespace plumb::simulated
