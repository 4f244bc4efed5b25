// The motion within an image, from what its rows show.
#pragma once

#include "algo/sensor_model/calibration_model.hpp"
#include "algo/tracking/map.hpp"

namespace plumb {

struct VelocityOptions {
  double marker_length_m = 0.104;
  double keypoint_sigma_px = 0.6;  ///< At 640 columns.
  double min_corner_sigma_px = 0.05;
  /// Standard deviations of what the keyframes' present velocities leave unsaid.
  double turning_sigma_rad_per_s = 0.05;
  double shifting_sigma_m_per_s = 0.03;
};

/// Moves MapKeyframe::velocity_per_s of each keyframe to where the rows of its own image agree with
/// the map: an image's rows are taken one after the other, so its keypoints and marker corners show
/// how the camera moved meanwhile, which the poses of a stream of 15 images a second do not for a
/// trembling hand. Each keyframe by itself: pose and velocity together, about the map as it is; the
/// present velocity is the prior. Landmarks, markers and poses stay. Deterministic; parallel over
/// keyframes.
void RefineVelocities(const Intrinsics& stated, const CalibrationModel& calibration,
                      const VelocityOptions& options, TrackingMap& map);

}  // namespace plumb
