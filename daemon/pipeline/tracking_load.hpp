// How far tracking is behind a live sensor.
#pragma once

namespace plumb {

/// State when a frame arrives at tracking.
struct TrackingLoad {
  double frame_period_s = 0.0;  ///< Time between the sensor's frames; 0 if unknown.
  double tracking_s = 0.0;      ///< Recent time to track one frame; 0 if unknown.
  double late_s = 0.0;          ///< Lateness of tracking behind the sensor.
  /// Since the last change of the stride or of the keypoints, or the start of the sweep.
  double since_change_s = 0.0;
};

}  // namespace plumb
