// SPDX-License-Identifier: Apache-2.0
// How well a solution explains keypoints and marker corners that took no part in it.
#pragma once

#include "algo/base/intrinsics.hpp"
#include "algo/map/map.hpp"
#include "algo/sensor_calibration/calibration_model.hpp"

namespace plumb {

/// Median distances, in pixels at 640 columns, of the observations that IsWitness() keeps out of
/// the joint solve. They reveal a path that errors of the depth images have bent, because the solve
/// cannot adapt the path to these observations.
struct WitnessErrors {
  double keypoints_px = 0.0;
  double corners_px = 0.0;
  int num_keypoints = 0;  ///< Observations.
  int num_corners = 0;
};

/// Fewest observations of a landmark that is kept out: only more than two observations of three
/// unknowns can contradict each other.
inline constexpr int kMinWitnessViews = 4;

/// Whether a landmark is kept out of the joint solve.
[[nodiscard]] bool IsWitness(const Landmark& landmark, int id);
/// Whether a keyframe's view of a marker is kept out of the joint solve. Of a marker with few views
/// none is.
[[nodiscard]] bool IsWitness(const MapMarker& marker, int id, int keyframe);

/// Errors of the observations that were kept out. Landmarks are triangulated from their own
/// observations; cameras, markers and calibration stay as they are. The same on any number of
/// threads.
[[nodiscard]] WitnessErrors ErrorsOfWitnesses(const Intrinsics& stated,
                                              const CalibrationModel& calibration,
                                              double marker_length_m, const TrackingMap& map);

/// Whether `after` contradicts the witnesses more than `before` did, by more than chance.
[[nodiscard]] bool ContradictsWitnesses(const WitnessErrors& before, const WitnessErrors& after);

}  // namespace plumb
