// SPDX-License-Identifier: Apache-2.0
// Turns a stream of RGB-D frames into a scene: one class for the whole method.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>

#include "algo/base/message.hpp"
#include "algo/sensor_model/sensor_profile.hpp"
#include "algo/types/frame.hpp"
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

/// Outcome of tracking one frame, for guidance during the sweep.
struct TrackingReport {
  bool tracked = false;
  bool is_keyframe = false;
  int num_keypoints = 0;  ///< Inlier landmarks.
  int num_markers = 0;    ///< Markers used for the pose.
  Pose T_world_camera =
      Pose::Identity();  ///< At the depth stamp; live estimate in the tracker's own world.
  /// From the tracker's world to the reference marker's frame, by the current estimate of the
  /// marker in the map. Nothing until it has been seen.
  std::optional<Pose> T_scene_world = {};
  double median_depth_m = 0;  ///< 0 without valid depth.
  double valid_depth = 0;     ///< Fraction of pixels with depth.
};

/// Turns a stream of frames into a scene. AddFrame() tracks and prepares each frame, so that
/// Finish() only has to solve the joint problem and make the surfaces and the height map. Call from
/// one thread; the work is spread over TBB's threads. Deterministic: the same frames and options
/// give the same scene bit for bit on any number of threads.
class Reconstructor {
 public:
  /// @throws DataError if the stream's marker dictionary is unknown, or its intrinsics or depth
  ///         noise are invalid.
  Reconstructor(const StreamInfo& info, const ReconstructorOptions& options);
  ~Reconstructor();

  /// @throws DataError if the images do not have the size stated by the intrinsics.
  TrackingReport AddFrame(const Frame& frame);

  /// Counts a frame that was dropped before it arrived here (live, too slow).
  void CountDropped(int num_frames);

  /// The scene. Call once, after the last frame.
  /// @throws DataError if nothing can be reconstructed: fewer than two frames, or no valid depth.
  /// @throws Interrupted on a stop request.
  [[nodiscard]] Scene Finish(
      const std::stop_token& stop = {},
      const std::function<void(double fraction, const Message& what)>& progress = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
