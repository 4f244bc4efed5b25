// SPDX-License-Identifier: Apache-2.0
// Estimates the motion during an image from its rows.
#pragma once

#include "algo/map/map.hpp"
#include "algo/sensor_calibration/calibration_model.hpp"

namespace plumb {

struct VelocityOptions {
  double marker_length_m = 0.0;     ///< Required: the room's, see CornersInMarkerFrame().
  double keypoint_sigma_px = 0.6;   ///< In pixels at 640 columns.
  bool keep_witnesses_out = false;  ///< Leave out what IsWitness() selects.
  double min_corner_sigma_px = 0.05;
  /// Standard deviations of the keyframes' present velocities.
  double turning_sigma_rad_per_s = 0.05;
  double shifting_sigma_m_per_s = 0.03;
};

/// Moves MapKeyframe::velocity_per_s of each keyframe to where the rows of its own image agree with
/// the map. The rows of an image are read one after the other, so its keypoints and marker corners
/// show how the camera moved during the readout. For a trembling hand, the poses of a stream of 15
/// images per second do not show this. Each keyframe is solved separately for pose and velocity
/// about the present map, with the present velocity as the prior. Landmarks, markers and poses
/// stay. Deterministic and parallel over keyframes.
void RefineVelocities(const Intrinsics& stated, const CalibrationModel& calibration,
                      const VelocityOptions& options, TrackingMap& map);

}  // namespace plumb
