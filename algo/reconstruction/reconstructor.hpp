// SPDX-License-Identifier: Apache-2.0
// Turns a stream of RGB-D frames into a scene: one class for the whole method.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>

#include "algo/base/message.hpp"
#include "algo/reconstruction/reconstructor_options.hpp"
#include "algo/types/frame.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

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

  /// What makes the scene of the frames that were added until now, while more are added: for an
  /// answer that forms during the sweep, from 48 keyframes at most. Nothing is learned from it.
  /// Call the function once, from any thread; it throws what Finish() does.
  [[nodiscard]] std::function<Scene(const std::stop_token&)> SceneUpToNow() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
