// SPDX-License-Identifier: Apache-2.0
// Where a sensor at rest is, by the scene's markers, and whether it still is there.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/base/pose.hpp"
#include "algo/markers/marker_detector.hpp"
#include "algo/types/marker.hpp"

namespace plumb {

using SeenCorners = std::map<int, ImageCorners>;  ///< By marker id, pixels.

struct SensorPlace {
  Pose T_camera_scene = Pose::Identity();
  std::vector<int> markers = {};  ///< Those that agree with it, ascending.
  double residual_px = 0.0;       ///< Root mean square over their corners.
};

/// The pose from all corners together, robust against markers that moved since the scene was made.
/// Nothing from fewer than four markers that agree within 3 px.
[[nodiscard]] std::optional<SensorPlace> PlaceByMarkers(const SeenCorners& seen,
                                                        const MarkerMap& scene,
                                                        const Intrinsics& camera);

/// Means of the corners over several images, of the markers that most of them show.
class CornerMeans {
 public:
  void Add(const SeenCorners& seen);
  [[nodiscard]] int num_images() const { return num_images_; }
  [[nodiscard]] SeenCorners Means() const;
  /// Root mean square of one coordinate about its mean; 0 from one image.
  [[nodiscard]] double Scatter_px() const;

 private:
  struct Sum {
    std::array<Eigen::Vector2d, 4> sum{}, squares{};
    int count = 0;
  };
  std::map<int, Sum> sums_;
  int num_images_ = 0;
};

/// What the markers say about the sensor.
struct PlaceCheck {
  int num_seen = 0;                      ///< Of the markers known at the start.
  std::vector<int> still = {};           ///< Markers that are where they were, ascending.
  Pose T_now_before = Pose::Identity();  ///< Of the camera frame, if all markers moved together.
  double shift_m = 0.0;                  ///< By which that moves the body in the camera frame,
  double turn_rad = 0.0;                 ///< and turns it.
  bool sensor_moved = false;
  bool couch_moved = false;  ///< Markers moved, but the sensor did not.
};

/// Watches the markers of one sensor at a few images a second. Not thread-safe.
class PlaceWatch {
 public:
  /// @param place      At the start, with the mean corners by which it was found.
  /// @param scatter_px See CornerMeans::Scatter_px().
  /// @param body_m     Middle of the body, scene frame.
  PlaceWatch(const Intrinsics& camera, const MarkerMap& scene, const SensorPlace& place,
             SeenCorners corners, double scatter_px, const Eigen::Vector3d& body_m);

  /// Judges by the last three images together, so that a sensor that sways by tenths of a
  /// millimetre has not moved.
  /// @param background_still  Whether what lies behind body and couch is where it was, or has moved
  ///         against the camera as given; nothing if there is too little of it. Asked only where
  ///         all markers have moved.
  [[nodiscard]] PlaceCheck Check(
      const SeenCorners& seen,
      const std::function<std::optional<bool>(const Pose& T_now_before)>& background_still);

  /// The next image is judged without those before it: the sensor was away.
  void Forget() { recent_.clear(); }

  /// Corners near which to search.
  [[nodiscard]] std::vector<ImageCorners> Expected() const;
  [[nodiscard]] const SeenCorners& at_start() const { return start_; }

 private:
  /// What the markers seen now leave open, in standard deviations.
  struct Doubt {
    double shift_m = 0.0, turn_rad = 0.0;  ///< Of the body, and of the camera frame.
  };
  /// Motion of the camera frame that explains the shifts of the corners.
  [[nodiscard]] Pose MotionOf(const SeenCorners& now, Doubt& doubt) const;

  Intrinsics camera_;
  std::map<int, MarkerCorners> in_camera_;
  SeenCorners start_, last_;
  std::vector<SeenCorners> recent_;
  Eigen::Vector3d body_camera_;
  double scatter_px_, still_px_, shift_limit_m_, turn_limit_rad_;
};

}  // namespace plumb
