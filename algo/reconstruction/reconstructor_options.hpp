// SPDX-License-Identifier: Apache-2.0
// Options of the whole method.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>

#include "algo/sensor_calibration/sensor_profile.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

struct ReconstructorOptions {
  Preset preset = Preset::kBest;
  bool keep_color = true;     ///< False: clouds and meshes carry no colours (patients).
  bool use_markers = true;    ///< False: track and reconstruct by keypoints and depth alone.
  bool use_keypoints = true;  ///< False: track by markers (and depth) alone.
  /// Steps of preset `best`; each may be switched off to measure its contribution.
  /// Estimate each keyframe's velocity from the rows of its own image.
  bool use_row_motion = true;
  /// Estimate the camera's tone curve and measure the markers with it.
  bool use_tone_curve = true;
  bool use_depth_field = true;  ///< Estimate the distortion of the depth image.
  bool use_dense_depth = true;  ///< Register overlapping depth images.
  /// Spacing of the keyframes relative to the default, 0.5 to 2. Accuracy figures should hold for
  /// several spacings.
  double keyframe_spacing = 1.0;
  /// Largest numbers of keyframes that keep their images and that enter the joint solve. They bound
  /// the memory of long sweeps; 300 frames have about 50 keyframes at 30 Hz and
  /// 70 at 15 Hz.
  std::size_t max_images = 96;
  std::size_t max_keyframes = 128;
  /// Serial number of the sensor, for `SensorSensitivity::serial`; empty if unknown.
  std::string sensor_serial;
  /// Profile of the sensor unit. Without one the sweep starts from the stated calibration.
  std::optional<SensorProfile> profile;
  /// Called by Finish() with the profile updated by this sweep, unless the sweep's own checks
  /// failed.
  std::function<void(const SensorProfile&)> on_learned;
  int num_icp_iterations = 20;  ///< Preset `paper`: iterations of Algorithm 1.
  unsigned seed = 1;            ///< Seed of the random subsampling.
  /// Wall clock in seconds for `Scene::timings_s`; may be empty. The method itself never reads a
  /// clock.
  std::function<double()> now_s;
};

}  // namespace plumb
