// SPDX-License-Identifier: Apache-2.0
// The bodies in the simulated room: a mannequin's torso and a whole body, both modelled for Plumb.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace plumb::simulated {

enum class BodyKind { kTorso, kFullBody };

/// Parameters of one body of its kind. Body frame: supine, x from head to feet, y to the body's
/// left, z up (front); the back touches about z = 0, the torso's middle is at about x = 0.
struct BodyShape {
  BodyKind kind = BodyKind::kTorso;
  double right_arm_abduction_rad =
      0.0;  ///< Full body: rotation of the right arm about the shoulder, away from the trunk.
  double belly_rise_m = 0.0;  ///< Rise of the belly (breathing, filling); negative: lower.
  double chest_rise_m = 0.0;  ///< Rise of the chest.
};

/// Implicit function of the body's surface: smooth union of ellipsoids and tapered capsules,
/// negative inside. Near the surface it is approximately the distance in metres; farther away only
/// its sign is meaningful. Pure, so it may be called from any number of threads.
[[nodiscard]] double BodyImplicit(const BodyShape& shape, const Eigen::Vector3d& p_body);

/// A box that contains the body with a margin of some centimetres.
[[nodiscard]] Eigen::AlignedBox3d BodyBox(const BodyShape& shape);

}  // namespace plumb::simulated
