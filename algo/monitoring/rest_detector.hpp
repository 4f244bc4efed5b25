// SPDX-License-Identifier: Apache-2.0
// Whether a sensor has been put down where it sees a scene's markers.
#pragma once

#include <optional>

#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/markers/marker_detector.hpp"
#include "algo/monitoring/sensor_place.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// Looks at a few images a second. Not thread-safe.
class RestDetector {
 public:
  /// @param scene  Only its markers count.
  /// @throws std::invalid_argument for an unknown dictionary.
  RestDetector(const Scene& scene, const Intrinsics& camera);

  /// @param color  CV_8UC3 of the camera's size.
  [[nodiscard]] bool Add(double time_s, const cv::Mat& color);
  /// @param time_s  Later than the one before; after a gap of over a second the rest starts again.
  /// @param seen    Markers of the image. An image that repeats the one before says nothing of
  ///        rest: no two images of a real sensor have the same corners.
  /// @return Whether at least four of the scene's markers have stood still for two seconds.
  [[nodiscard]] bool Add(double time_s, const SeenCorners& seen);

 private:
  void Restart(double time_s, SeenCorners known);

  MarkerMap scene_;
  MarkerDetector detector_;
  double limit_px_;
  SeenCorners start_, last_;
  std::optional<double> since_s_, last_s_;
};

}  // namespace plumb
