// SPDX-License-Identifier: Apache-2.0
// Scenes made from formulas, for tests of what works on scenes: a body on a floor or couch with
// markers, sampled as a scan would.
#pragma once

#include <functional>
#include <set>

#include <Eigen/Core>

#include "algo/base/pose.hpp"
#include "algo/types/scene.hpp"

namespace plumb::test {

enum class BodyShape {
  kTorso,      ///< Asymmetrical, 0.6 m long, about 0.2 m high, ends included.
  kTorsoWide,  ///< Another person: broader, flatter, other bumps.
  kFullBody,   ///< 1.7 m: head, arms, legs.
  kCylinder,  ///< Round bar of radius 0.12 m, 0.6 m long, flat ends not sampled: its roll cannot be
              ///< seen.
};

/// How a scene is made. The reference frame is the scene's own: z = 0 is where the markers lie.
struct SyntheticOptions {
  BodyShape shape = BodyShape::kTorso;
  Pose T_reference_body = Pose::Identity();  ///< Where the body lies; its own frame: x to the head,
                                             ///< z up, origin under its middle.
  unsigned seed = 1;                         ///< Of noise and sampling.
  double noise_m =
      0.0;  ///< Standard deviation of smooth noise along the normal, wavelength some centimetres.
  double normal_noise_rad = 0.0;
  double min_up = 0.03;  ///< Steeper parts (normal's z) are not seen.
  std::function<bool(const Eigen::Vector3d& p_reference)> hidden;  ///< Parts that this scan missed.
  std::function<Eigen::Vector3d(const Eigen::Vector3d& p_body)>
      deform;          ///< Displacement in the body's frame (arm, belly).
  bool couch = false;  ///< The body lies on a couch top at z = 0, the floor 0.7 m below.
  double marker_noise_m = 0.0;
  Pose T_scene_reference =
      Pose::Identity();  ///< Not the identity: frame first_keyframe, no height map.
  std::set<int> hidden_markers;
  bool with_cloud = true;
};

/// Surface point and outward normal of a body at parameters u, v in [0, 1]; body frame, metres.
struct BodySample {
  Eigen::Vector3d p;
  Eigen::Vector3d normal;
};
[[nodiscard]] BodySample SampleBody(BodyShape shape, double u, double v);

/// Mean of the body's upper surface in its own frame.
[[nodiscard]] Eigen::Vector3d BodyCentroid(BodyShape shape);

[[nodiscard]] Scene MakeSyntheticScene(const SyntheticOptions& options);

/// For a scene whose sensor's calibration is known exactly: nothing of the body's place hangs on
/// it.
[[nodiscard]] SensorSensitivity KnownCalibration(const Scene& scene);

/// p_current = M p_reference of a body carried by a yaw about its own place, tilted and shifted.
[[nodiscard]] Pose BodyMotionAbout(const Eigen::Vector3d& centre, const Eigen::Vector3d& shift_m,
                                   double yaw_deg, double pitch_deg = 0.0, double roll_deg = 0.0);

}  // namespace plumb::test
