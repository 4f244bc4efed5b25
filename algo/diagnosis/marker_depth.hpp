// SPDX-License-Identifier: Apache-2.0
// Depth on a marker's face against the distance that its size shows, before anything is solved.
#pragma once

#include <optional>
#include <vector>

#include "algo/base/intrinsics.hpp"
#include "algo/map/map.hpp"
#include "algo/sensor_calibration/calibration_model.hpp"

namespace plumb {

struct MarkerDepth {
  int id = 0;
  /// Measured depth over the distance at which a square of the stated side appears as large; median
  /// over the views.
  double ratio = 1.0;
  double scatter = 0.0;  ///< Standard deviation of one view's ratio, from the median deviation.
  int num_views = 0;     ///< Keyframes with depth on the marker's face.
};

/// Measured depth over the distance at which a square of the stated side appears as large, median
/// over the face; nothing without a pose of the marker or enough depth.
/// @param depth_m  Of the size that `intrinsics` state, or at working resolution.
[[nodiscard]] std::optional<double> DepthRatioOnFace(const MarkerObservation& marker,
                                                     const cv::Mat& depth_m,
                                                     const Intrinsics& intrinsics, double length_m);

/// How the depth image lies on the colour image.
enum class DepthLayout { kAsStated, kMirrored, kUpsideDown, kTurned /*by half a turn*/ };

/// The markers in the keyframes that still have their depth image, by ascending id.
/// @param known  Errors of the sensor's depth that are known before the sweep.
/// @param length_m  Stated side of the black square, positive.
[[nodiscard]] std::vector<MarkerDepth> MeasureMarkerDepths(const TrackingMap& map,
                                                           const Intrinsics& intrinsics,
                                                           const CalibrationModel& known,
                                                           double length_m);

/// The layout in which depth agrees with the markers' size from view to view, where as stated it
/// does not, and another one does clearly better.
/// @return kAsStated also if no layout explains the disagreement.
[[nodiscard]] DepthLayout FindDepthLayout(const TrackingMap& map, const Intrinsics& intrinsics,
                                          const CalibrationModel& known, double length_m);

}  // namespace plumb
