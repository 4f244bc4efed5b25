// From a stream of RGB-D frames to a scene: the whole chain of the method behind one class.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string_view>

#include "algo/sensor_model/sensor_profile.hpp"
#include "algo/types/frame.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

struct ReconstructorOptions {
  Preset preset = Preset::kBest;
  bool keep_color = true;     ///< false: clouds and meshes carry no colours (patients).
  bool use_markers = true;    ///< false: track and reconstruct by keypoints and depth alone.
  bool use_keypoints = true;  ///< false: track by markers (and depth) alone.
  /// Preset `best`; each may be switched off to see what it is worth.
  bool use_row_motion = true;   ///< Find each keyframe's velocity from the rows of its own image.
  bool use_tone_curve = true;   ///< Find the camera's tone curve and measure the markers under it.
  bool use_depth_field = true;  ///< Find the depth image's distortion over the image.
  bool use_dense_depth = true;  ///< Register overlapping depth images.
  /// Of the usual motion between keyframes, 0.5 to 2. Figures of accuracy that hold at one spacing
  /// only are luck.
  double keyframe_spacing = 1.0;
  /// What is known of the sensor unit; without it the sweep begins from the stated calibration.
  std::optional<SensorProfile> profile;
  /// Called by Finish() with the profile that this sweep makes of `profile`, unless the sweep's own
  /// checks failed.
  std::function<void(const SensorProfile&)> on_learned;
  int num_icp_iterations = 20;  ///< Preset `paper`: iterations of Algorithm 1.
  unsigned seed = 1;            ///< Of random subsampling.
  /// Wall clock in seconds for `Scene::timings_s`; none: no timings. The method itself never looks
  /// at a clock.
  std::function<double()> now_s;
};

/// The outcome of tracking one frame; for guidance while sweeping.
struct TrackingReport {
  bool tracked = false;
  bool is_keyframe = false;
  int num_keypoints = 0;  ///< Inlier landmarks.
  int num_markers = 0;    ///< Markers that took part.
  Pose T_world_camera =
      Pose::Identity();  ///< At the depth stamp; live estimate in the tracker's own world.
  /// From that world to the reference marker's frame, by the marker as the map has it now; nothing
  /// while it has not been seen.
  std::optional<Pose> T_scene_world = {};
  double median_depth_m = 0;  ///< 0: no valid depth.
  double valid_depth = 0;     ///< Share of pixels with depth.
};

/// Streams frames into a scene: AddFrame() tracks and prepares, so that Finish() has only the joint
/// solve, the surfaces and the height map left. One thread calls; inside, work is spread over TBB's
/// threads. Deterministic: same frames, same options, same scene bit for bit, whatever the number
/// of threads.
class Reconstructor {
 public:
  /// @throws DataError if the stream's marker dictionary is unknown or its intrinsics make no
  /// sense.
  Reconstructor(const StreamInfo& info, const ReconstructorOptions& options);
  ~Reconstructor();

  /// @throws DataError if the images do not have the size that the intrinsics state.
  TrackingReport AddFrame(const Frame& frame);

  /// A frame was dropped before it came here (live, too slow): counted only.
  void CountDropped(int num_frames);

  /// The scene. Call once, last.
  /// @throws DataError if nothing can be reconstructed: fewer than two frames, no valid depth
  /// anywhere.
  /// @throws Interrupted on a stop request.
  [[nodiscard]] Scene Finish(
      const std::stop_token& stop = {},
      const std::function<void(double fraction, std::string_view what)>& progress = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
