// SPDX-License-Identifier: Apache-2.0
// What a sensor at rest sees of a synthetic body that breathes and is moved, cheap enough for unit
// tests: two depth images, between which every frame lies.
#pragma once

#include <random>

#include <opencv2/core/mat.hpp>

#include "algo/base/pose.hpp"
#include "algo/types/frame.hpp"
#include "algo/types/scene.hpp"

namespace plumb::test {

/// A torso with markers around it, as it was scanned; reference marker's frame.
[[nodiscard]] Scene ScannedBody();
/// Where it lies: about the middle of its region.
[[nodiscard]] Eigen::Vector3d MiddleOfBody();

/// One sensor over it, with independent noise of a millimetre.
class RestFrames {
 public:
  static constexpr double kRate_hz = 15.0;
  static constexpr double kBreath_s = 4.0;
  static constexpr double kBelly_m = 0.006;

  /// @param side  Of the body, 1 or -1.
  RestFrames(const Scene& scene, double side, unsigned seed);

  [[nodiscard]] StreamInfo info() const;
  [[nodiscard]] const Pose& T_camera_scene() const { return T_camera_scene_; }
  /// @param covered  Something lies before the body; the markers are seen.
  [[nodiscard]] Frame At(double time_s, bool covered = false);
  /// The body lies elsewhere from now on. @param T_motion  Scene frame.
  void Move(const Pose& T_motion);
  /// All depth is this many times as long from now on, as of a sensor that warms up.
  void Stretch(double factor) { stretch_ = static_cast<float>(factor); }
  /// Without noise, and the breath in steps, as simulated bodies have it.
  void Silence() { noise_m_ = 0.0F; }
  /// The sensor was pushed.
  void Push(const Eigen::Vector3d& shift_m);

 private:
  void Render();

  const Scene& scene_;
  Pose T_camera_scene_ = Pose::Identity(), T_motion_ = Pose::Identity();
  cv::Mat exhaled_m_, inhaled_m_, color_;
  std::mt19937 random_;
  float stretch_ = 1.0F, noise_m_ = 0.001F;
  std::int64_t next_ = 0;
};

}  // namespace plumb::test
