#include "algo/reconstruction/trajectory.hpp"

#include <algorithm>

namespace plumb {
namespace {

constexpr double kMaxGap_s = 0.3;  // Neighbours farther apart say nothing about a velocity.

constexpr double kUsualSpacings =
    3.0;  // A live stream on a busy machine skips one or two images at a time.

// Median, so that gaps do not count as usual, and a recording of any rate has its own.
double UsualSpacing(const std::vector<TrackedFrame>& frames) {
  std::vector<double> spacings_s;
  for (std::size_t i = 1; i < frames.size(); ++i)
    spacings_s.push_back(frames[i].color_time_s - frames[i - 1].color_time_s);
  const auto middle = spacings_s.begin() + static_cast<std::ptrdiff_t>(spacings_s.size() / 2);
  std::nth_element(spacings_s.begin(), middle, spacings_s.end());
  return *middle;
}

const Pose& KeyframePose(const TrackingMap& map, int keyframe) {
  return map.keyframes.at(static_cast<std::size_t>(keyframe)).T_world_color;
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
      poses[i] = KeyframePose(map, frames[i].reference_keyframe) * frames[i].T_reference_color *
                 Interpolate(Pose::Identity(), T_color_correction, fraction);
    }
  };
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const TrackedFrame& frame = frames[i];
    if (frame.keyframe < 0) continue;
    Pose T_correction = Pose::Identity();
    double t0 = frame.color_time_s;
    const bool continues = begin > 0 && frames[begin - 1].keyframe == frame.previous_keyframe &&
                           frame.previous_keyframe >= 0;
    if (continues) {
      T_correction =
          (KeyframePose(map, frame.previous_keyframe) * frame.T_previous_color).inverse() *
          KeyframePose(map, frame.keyframe);
      t0 = frames[begin - 1].color_time_s;
    }
    spread(i, T_correction, t0, frame.color_time_s);
    poses[i] = KeyframePose(map, frame.keyframe);
    begin = i + 1;
  }
  spread(frames.size(), Pose::Identity(), 0, 0);
  return poses;
}

void RefreshVelocities(std::vector<TrackedFrame>& frames, TrackingMap& map) {
  const std::vector<Pose> poses = ColorPoses(frames, map);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!frames[i].tracked) continue;
    const auto usable = [&](std::size_t j) {
      return j < frames.size() && frames[j].tracked &&
             std::abs(frames[j].color_time_s - frames[i].color_time_s) < kMaxGap_s;
    };
    const std::size_t a = i > 0 && usable(i - 1) ? i - 1 : i;
    const std::size_t b = usable(i + 1) ? i + 1 : i;
    const double dt = frames[b].color_time_s - frames[a].color_time_s;
    if (!(dt > 0)) continue;
    frames[i].velocity_per_s = TwistFromPose(poses[a].inverse() * poses[b]) / dt;
    if (frames[i].keyframe >= 0)
      map.keyframes[static_cast<std::size_t>(frames[i].keyframe)].velocity_per_s =
          frames[i].velocity_per_s;
  }
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
    trajectory.push_back({frames[i].depth_time_s,
                          T_scene_world * PoseAfter(poses[i], frames[i].velocity_per_s, dt)});
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
