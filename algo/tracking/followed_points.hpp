// SPDX-License-Identifier: Apache-2.0
// The landmarks that are tracked from frame to frame, and their pixels in the last frame.
#pragma once

#include <cstddef>
#include <deque>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/base/pose.hpp"
#include "algo/map/map.hpp"
#include "algo/sensor_model/depth_noise.hpp"
#include "algo/tracking/keypoints.hpp"
#include "algo/tracking/pose_optimizer.hpp"

namespace plumb {

struct ActivePoint {
  int landmark = 0;
  Eigen::Vector2f pixel;
};

/// One grey-level image with its pyramid.
struct GrayImage {
  cv::Mat gray;
  Pyramid pyramid;
};

/// Tracks keypoints over the map of one tracker. Not thread-safe.
class FollowedPoints {
 public:
  /// @param map  Must outlive this object.
  FollowedPoints(const Intrinsics& intrinsics, const DepthNoise& depth_noise, TrackingMap& map)
      : intrinsics_(intrinsics), depth_noise_(depth_noise), map_(map) {}

  [[nodiscard]] const std::vector<ActivePoint>& points() const { return active_; }
  void SetPoints(std::vector<ActivePoint> points) { active_ = std::move(points); }
  [[nodiscard]] Pyramid PyramidOf(const cv::Mat& gray) const { return MakePyramid(gray, options_); }

  /// Tracks the points into a new image by KLT, starting from the guessed pose.
  /// @param followed  Receives the tracked points, and `points` the input of the pose in the same
  ///         order.
  void Follow(const Pyramid& last, const GrayImage& image, const cv::Mat& depth_m,
              const Pose& T_world_guess, std::vector<ActivePoint>& followed,
              std::vector<PosePoint>& points) const;

  /// Searches for landmarks of older keyframes that are not being tracked; appends those found to
  /// points() and to `points`.
  void Reassociate(const GrayImage& image, const cv::Mat& depth_m, const Pose& T_world_color,
                   const std::vector<std::size_t>& keyframes, std::vector<PosePoint>& points);

  /// Stores a new keyframe's pyramid, which Reassociate() will soon use.
  void KeepPyramid(std::size_t keyframe, const Pyramid& pyramid);

  /// Records the observation of a point in a keyframe.
  void AddObservation(const ActivePoint& point, MapKeyframe& keyframe);

  /// The points() from `first` on were found again at `found`: those that fit the keyframe's pose
  /// are recorded as observed in it, the others are dropped.
  void Observe(const std::vector<PosePoint>& found, std::size_t first, MapKeyframe& keyframe);

  /// Stops following all but the oldest point in each of the larger cells for fewer keypoints.
  /// Their landmarks stay in the map, and Reassociate() may find them again.
  void KeepOnePerCell();

  /// Creates new landmarks at corners of a keyframe's image where no landmark is tracked.
  /// @param index  Index of the keyframe.
  /// @param fewer  In the larger cells for fewer keypoints.
  void AddCorners(const GrayImage& image, const cv::Mat& depth_m, int index, bool fewer,
                  MapKeyframe& keyframe);

 private:
  [[nodiscard]] double SigmaPx() const { return intrinsics_.width / 640.0; }
  [[nodiscard]] KltResult FollowAtAnyBrightness(const Pyramid& before, const GrayImage& image,
                                                const std::vector<Eigen::Vector2f>& from,
                                                const std::vector<Eigen::Vector2f>& guesses,
                                                int max_level) const;

  [[nodiscard]] Pyramid PyramidOfKeyframe(std::size_t keyframe);

  const Intrinsics intrinsics_;
  const DepthNoise depth_noise_;
  const KeypointOptions options_;
  const KeypointOptions fewer_options_{.cell_px = kFewerCell_px};
  TrackingMap& map_;
  std::vector<ActivePoint> active_;
  // Pyramids of keyframes, the last used first.
  std::deque<std::pair<std::size_t, Pyramid>> pyramids_;
};

}  // namespace plumb
