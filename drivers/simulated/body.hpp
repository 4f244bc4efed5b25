// The bodies that lie in the simulated room: a mannequin's torso and a whole body, of our own
// making.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace plumb::simulated {

enum class BodyKind { kTorso, kFullBody };

/// What makes one body differ from another of its kind. Body frame: supine, x from head to feet, y
/// to the body's left, z up (front); the back touches about z = 0, the torso's middle is about x =
/// 0.
struct BodyShape {
  BodyKind kind = BodyKind::kTorso;
  double right_arm_abduction_rad =
      0.0;                    ///< Full body: right arm away from the trunk, about the shoulder.
  double belly_rise_m = 0.0;  ///< Belly higher by this much (breathing, filling); negative: lower.
  double chest_rise_m = 0.0;  ///< Chest likewise.
};

/// Implicit function of the body's surface: smooth union of ellipsoids and tapered capsules;
/// negative inside. Near the surface it is about the distance in metres, further away only its sign
/// counts. Pure, so any number of threads may call it.
[[nodiscard]] double BodyImplicit(const BodyShape& shape, const Eigen::Vector3d& p_body);

/// A box that holds the body with some centimetres of room.
[[nodiscard]] Eigen::AlignedBox3d BodyBox(const BodyShape& shape);

}  // namespace plumb::simulated
