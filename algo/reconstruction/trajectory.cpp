// SPDX-License-Identifier: Apache-2.0
#include "algo/reconstruction/trajectory.hpp"

#include <algorithm>

namespace plumb {
namespace {

constexpr double kMaxGap_s = 0.3;  // Frames farther apart do not determine a velocity.

constexpr double kUsualSpacings =
    3.0;  // A live stream on a busy machine may skip one or two images in a row.

const Pose& KeyframePose(const TrackingMap& map, int keyframe) {
  return map.keyframes.at(static_cast<std::size_t>(keyframe)).T_world_color;
}

// First derivatives at the knots of the natural cubic spline whose chords have these mean
// derivatives: the usual tridiagonal system, solved by elimination.
std::vector<Vector6d> SplineDerivatives(const std::vector<double>& spacings_s,
                                        const std::vector<Vector6d>& chords_per_s) {
  const std::size_t n = chords_per_s.size() + 1;
  std::vector<double> upper(n);
  std::vector<Vector6d> v(n);
  upper[0] = 0.5;
  v[0] = 1.5 * chords_per_s[0];
  for (std::size_t i = 1; i < n; ++i) {
    const bool last = i + 1 == n;
    const double before_s = spacings_s[i - 1];
    const double after_s = last ? 0.0 : spacings_s[i];
    const double lower = last ? 1.0 : after_s;
    const double diagonal = last ? 2.0 : 2.0 * (before_s + after_s);
    const Vector6d right =
        last ? Vector6d(3.0 * chords_per_s[i - 1])
             : Vector6d(3.0 * (after_s * chords_per_s[i - 1] + before_s * chords_per_s[i]));
    const double pivot = diagonal - lower * upper[i - 1];
    upper[i] = before_s / pivot;
    v[i] = (right - lower * v[i - 1]) / pivot;
  }
  for (std::size_t i = n - 1; i-- > 0;) v[i] -= upper[i] * v[i + 1];
  return v;
}

// Velocities of the frames [begin, end), which follow each other without a gap, in the world's
// axes. Hand tremor is at 4 to 12 Hz: at 30 images per second the central difference of the
// neighbouring poses shows half of it and a spline through all poses nine tenths, but with twice
// the noise of the poses. The mean of both was the best compromise on simulated and real
// recordings.
void RefreshStretch(std::size_t begin, std::size_t end, const std::vector<Pose>& poses,
                    std::vector<TrackedFrame>& frames) {
  std::vector<double> spacings_s;
  std::vector<Vector6d> chords_per_s;
  for (std::size_t i = begin; i + 1 < end; ++i) {
    spacings_s.push_back(frames[i + 1].color_time_s - frames[i].color_time_s);
    const Eigen::AngleAxisd turn(
        Eigen::Matrix3d(poses[i].linear().transpose() * poses[i + 1].linear()));
    Vector6d chord;
    chord << poses[i].linear() * (turn.angle() * turn.axis()),
        poses[i + 1].translation() - poses[i].translation();
    chords_per_s.push_back(chord / spacings_s.back());
  }
  std::vector<Vector6d> derivatives = SplineDerivatives(spacings_s, chords_per_s);
  for (std::size_t i = 0; i < derivatives.size(); ++i) {
    const std::size_t before = i > 0 ? i - 1 : 0;
    const std::size_t after = std::min(i, chords_per_s.size() - 1);
    const Vector6d difference =
        (chords_per_s[before] * spacings_s[before] + chords_per_s[after] * spacings_s[after]) /
        (spacings_s[before] + spacings_s[after]);
    derivatives[i] = 0.5 * (derivatives[i] + difference);
  }
  for (std::size_t i = begin; i < end; ++i) {
    const Eigen::Matrix3d R_camera_world = poses[i].linear().transpose();
    frames[i].velocity_per_s << R_camera_world * derivatives[i - begin].head<3>(),
        R_camera_world * derivatives[i - begin].tail<3>();
  }
}

}  // namespace

std::vector<Pose> ColorPoses(const std::vector<TrackedFrame>& frames, const TrackingMap& map) {
  std::vector<Pose> poses(frames.size(), Pose::Identity());
  std::size_t begin = 0;  // First frame after the last keyframe.
  const auto spread = [&](std::size_t end, const Pose& T_color_correction, double t0, double t1) {
    for (std::size_t i = begin; i < end; ++i) {
      if (!frames[i].tracked) continue;
      const double fraction =
          t1 > t0 ? std::clamp((frames[i].color_time_s - t0) / (t1 - t0), 0.0, 1.0) : 0.0;
      poses[i] = KeyframePose(map, frames[i].reference_keyframe.value()) *
                 frames[i].T_reference_color *
                 Interpolate(Pose::Identity(), T_color_correction, fraction);
    }
  };
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const TrackedFrame& frame = frames[i];
    if (!frame.keyframe) continue;
    Pose T_correction = Pose::Identity();
    double t0 = frame.color_time_s;
    const bool continues = begin > 0 && frame.previous_keyframe &&
                           frames[begin - 1].keyframe == frame.previous_keyframe;
    if (continues) {
      T_correction =
          (KeyframePose(map, *frame.previous_keyframe) * frame.T_previous_color).inverse() *
          KeyframePose(map, *frame.keyframe);
      t0 = frames[begin - 1].color_time_s;
    }
    spread(i, T_correction, t0, frame.color_time_s);
    poses[i] = KeyframePose(map, *frame.keyframe);
    begin = i + 1;
  }
  spread(frames.size(), Pose::Identity(), 0, 0);
  return poses;
}

void RefreshVelocities(std::vector<TrackedFrame>& frames, TrackingMap& map) {
  if (frames.size() < 2) return;
  const std::vector<Pose> poses = ColorPoses(frames, map);
  const double least_s = kLeastOfUsualSpacing * UsualSpacing(frames);
  std::size_t begin = 0;
  for (std::size_t end = 1; end <= frames.size(); ++end) {
    if (end < frames.size() && frames[end - 1].tracked && frames[end].tracked) {
      const double spacing_s = frames[end].color_time_s - frames[end - 1].color_time_s;
      if (spacing_s > least_s && spacing_s < kMaxGap_s) continue;
    }
    if (end - begin >= 2) RefreshStretch(begin, end, poses, frames);
    begin = end;
  }
  for (const TrackedFrame& frame : frames)
    if (frame.tracked && frame.keyframe)
      map.keyframe(*frame.keyframe).velocity_per_s = frame.velocity_per_s;
}

std::vector<StampedPose> DepthTrajectory(const std::vector<TrackedFrame>& frames,
                                         const TrackingMap& map,
                                         const CalibrationModel& calibration,
                                         const Pose& T_scene_world) {
  const std::vector<Pose> poses = ColorPoses(frames, map);
  std::vector<StampedPose> trajectory;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!frames[i].tracked) continue;
    const double dt =
        frames[i].depth_time_s - frames[i].color_time_s + calibration.depth[kDepthDelay];
    const Vector6d& velocity_per_s = frames[i].keyframe
                                         ? map.keyframe(*frames[i].keyframe).velocity_per_s
                                         : frames[i].velocity_per_s;
    trajectory.push_back(
        {frames[i].depth_time_s, T_scene_world * PoseAfter(poses[i], velocity_per_s, dt)});
  }
  return trajectory;
}

double LongestLost(const std::vector<TrackedFrame>& frames) {
  if (frames.size() < 2) return 0.0;
  const double longest_usual_s = kUsualSpacings * UsualSpacing(frames);
  double longest = 0.0;
  double last_tracked_s = frames.front().color_time_s;
  bool lost = false;
  for (const TrackedFrame& frame : frames) {
    if (!frame.tracked) {
      lost = true;
      longest = std::max(longest, frame.color_time_s - last_tracked_s);
      continue;
    }
    if (lost || frame.color_time_s - last_tracked_s > longest_usual_s)
      longest = std::max(longest, frame.color_time_s - last_tracked_s);
    lost = false;
    last_tracked_s = frame.color_time_s;
  }
  return longest;
}

}  // namespace plumb
