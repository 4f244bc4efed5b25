// How well a solution explains keypoints and marker corners that took no part in it.
#pragma once

#include "algo/base/intrinsics.hpp"
#include "algo/sensor_model/calibration_model.hpp"
#include "algo/tracking/map.hpp"

namespace plumb {

/// Median distances, in pixels at 640 columns, of the observations that IsWitness() keeps out of
/// the joint solve. A path that the depth images have bent shows here: the solve has no chance to
/// make these observations agree with it.
struct WitnessErrors {
  double keypoints_px = 0.0;
  double corners_px = 0.0;
  int num_keypoints = 0;  ///< Observations.
  int num_corners = 0;
};

/// Landmarks that have to be seen as often as this to be a witness: three unknowns need more than
/// two observations to be contradicted.
inline constexpr int kMinWitnessViews = 4;

/// Whether a landmark is kept out of the joint solve.
[[nodiscard]] bool IsWitness(const Landmark& landmark, int id);
/// Whether a keyframe's view of a marker is kept out of the joint solve. Markers of few views have
/// none.
[[nodiscard]] bool IsWitness(const MapMarker& marker, int id, int keyframe);

/// Each landmark is placed where its own observations want it; the cameras, the markers and the
/// calibration stay. The same on any number of threads.
[[nodiscard]] WitnessErrors ErrorsOfWitnesses(const Intrinsics& stated,
                                              const CalibrationModel& calibration,
                                              double marker_length_m, const TrackingMap& map);

/// Whether `after` contradicts the witnesses more than `before` did, by more than chance.
[[nodiscard]] bool ContradictsWitnesses(const WitnessErrors& before, const WitnessErrors& after);

}  // namespace plumb
