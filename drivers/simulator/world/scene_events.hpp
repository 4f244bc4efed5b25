// SPDX-License-Identifier: Apache-2.0
// Objects that move in the room during a sweep: a pushed marker, a cable, a hand, breathing.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "drivers/simulator/world/world.hpp"

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

/// One breath: both modes reach their ends at the end of inspiration.
struct OneBreath {
  double begin_s = 0.0;
  double end_s = 0.0;
  double belly_m = 0.0;  ///< Rise at the end of inspiration.
  double chest_m = 0.0;
};
/// A motion of the body, eased in and out, about a point that moves along.
struct BodyStep {
  double begin_s = 0.0;
  double end_s = 0.0;
  Vector6d twist = Vector6d::Zero();  ///< Rotation vector, translation; world.
};
/// What happens before a sensor at rest. Pure functions of time.
struct LiveScript {
  // The body exhaled, with the chest risen and with the belly risen by kRise_m.
  std::shared_ptr<const DistanceGrid> exhaled, chest, belly;
  static constexpr double kRise_m = 0.010;
  std::vector<OneBreath> breaths = {};
  double lag_s = 0.0;  ///< By which the chest follows the belly.
  Pose T_world_body = Pose::Identity();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< Of the motions: world, at the start.
  std::vector<BodyStep> steps = {};
  /// A thick arm, as that of a gantry, that passes between sensor and body.
  struct Passing {
    double begin_s = 0.0, end_s = 0.0;
    Rod from, to;
  };
  std::vector<Passing> passing = {};
  struct Stretch {
    double begin_s = 0.0, end_s = 0.0;
    [[nodiscard]] bool Has(double time_s) const { return time_s >= begin_s && time_s < end_s; }
  };
  std::vector<Stretch> dark = {};  ///< The lights are off: the colour camera sees nothing.
  /// A folded sheet lies on the chest, which is that much higher.
  std::vector<Stretch> sheet = {};
  static constexpr double kSheet_m = 0.025;

  [[nodiscard]] double BellyAt(double time_s) const;  ///< Rise, metres.
  [[nodiscard]] double ChestAt(double time_s) const;
  [[nodiscard]] bool DarkAt(double time_s) const;
  [[nodiscard]] Pose BodyAt(double time_s) const;  ///< T_world_body.
  [[nodiscard]] DistanceGrid ShapeAt(double time_s) const;
};

struct SceneEvents {
  std::optional<PushedBoard> pushed;
  std::optional<HandVisit> hand;
  std::optional<Breath> breath;
  std::shared_ptr<const LiveScript> live = {};
  bool cable = false;
  std::uint64_t seed = 1;
  [[nodiscard]] bool Any() const { return pushed || hand || breath || live || cable; }
};

/// The room at one moment. Moving objects are static during an image.
/// @param T_world_camera  Carries the cable.
[[nodiscard]] World WorldAt(const World& world, const SceneEvents& events, double time_s,
                            const Pose& T_world_camera);

}  // namespace plumb::simulated
