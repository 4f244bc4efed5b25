// The landmarks that are followed from frame to frame, and where the last frame saw them.
#pragma once

#include <cstddef>
#include <deque>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/base/pose.hpp"
#include "algo/tracking/keypoints.hpp"
#include "algo/tracking/map.hpp"
#include "algo/tracking/pose_optimizer.hpp"

namespace plumb {

struct ActivePoint {
  int landmark = 0;
  Eigen::Vector2f pixel;
};

/// One image in grey levels, with its pyramid.
struct GrayImage {
  cv::Mat gray;
  Pyramid pyramid;
};

/// Keypoints of one tracker over its map. One thread.
class FollowedPoints {
 public:
  /// @param map  Must outlive this.
  FollowedPoints(const Intrinsics& intrinsics, TrackingMap& map)
      : intrinsics_(intrinsics), map_(map) {}

  [[nodiscard]] const std::vector<ActivePoint>& points() const { return active_; }
  void SetPoints(std::vector<ActivePoint> points) { active_ = std::move(points); }
  [[nodiscard]] Pyramid PyramidOf(const cv::Mat& gray) const { return MakePyramid(gray, options_); }

  /// Those that KLT finds in a new image, near where the guessed pose sees them.
  /// @param followed  Gets them, and `points` what the pose is computed of, in the same order.
  void Follow(const Pyramid& last, const GrayImage& image, const cv::Mat& depth_m,
              const Pose& T_world_guess, std::vector<ActivePoint>& followed,
              std::vector<PosePoint>& points) const;

  /// Looks for landmarks of older keyframes that are not being followed; adds those found to
  /// points() and to `points`.
  void Reassociate(const GrayImage& image, const cv::Mat& depth_m, const Pose& T_world_color,
                   const std::vector<std::size_t>& keyframes, std::vector<PosePoint>& points);

  /// A new keyframe's pyramid: Reassociate() will ask for it soon.
  void KeepPyramid(std::size_t keyframe, const Pyramid& pyramid);

  /// Notes a point as seen in a keyframe.
  void AddObservation(const ActivePoint& point, MapKeyframe& keyframe);

  /// Of points(), those from `first` on were found again, at `found`: the ones that fit the
  /// keyframe's pose are seen in it, the others are dropped.
  void Observe(const std::vector<PosePoint>& found, std::size_t first, MapKeyframe& keyframe);

  /// Begins new landmarks at corners of a keyframe's image where none is followed.
  /// @param index  Of the keyframe.
  void AddCorners(const GrayImage& image, const cv::Mat& depth_m, int index, MapKeyframe& keyframe);

 private:
  [[nodiscard]] double SigmaPx() const { return intrinsics_.width / 640.0; }
  [[nodiscard]] KltResult FollowAtAnyBrightness(const Pyramid& before, const GrayImage& image,
                                                const std::vector<Eigen::Vector2f>& from,
                                                const std::vector<Eigen::Vector2f>& guesses,
                                                int max_level) const;

  [[nodiscard]] Pyramid PyramidOfKeyframe(std::size_t keyframe);

  const Intrinsics intrinsics_;
  const KeypointOptions options_;
  TrackingMap& map_;
  std::vector<ActivePoint> active_;
  std::deque<std::pair<std::size_t, Pyramid>> pyramids_;  // Of keyframes, used last first.
};

}  // namespace plumb
