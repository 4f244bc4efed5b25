// SPDX-License-Identifier: Apache-2.0
// Fiducial markers in images and in scenes.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace plumb {

/// Side of the black square where neither configuration, recording nor calibration file states it.
inline constexpr double kDefaultMarkerLength_m = 0.104;
/// Dictionary of the markers in the same case.
inline constexpr const char* kDefaultMarkerDictionary = "DICT_6X6_250";

/// The markers of a room.
struct RoomMarkers {
  /// OpenCV's name, or DICT_ARUCO_MIP_36h12.
  std::string dictionary = kDefaultMarkerDictionary;
  double length_m = kDefaultMarkerLength_m;  ///< Side of the black square.
  std::optional<int> reference = {};         ///< Id of the marker whose frame is the scene's frame.

  bool operator==(const RoomMarkers&) const = default;

  /// Where nothing is known of them: the length places no marker.
  [[nodiscard]] static RoomMarkers Unknown() { return {.dictionary = {}, .length_m = 0.0}; }
};

/// What a file states of a room's markers.
struct StatedMarkers {
  std::optional<std::string> dictionary = {};
  std::optional<double> length_m = {};
  std::optional<int> reference = {};

  /// These, and the others where they state nothing.
  [[nodiscard]] RoomMarkers Or(const RoomMarkers& others) const {
    return {.dictionary = dictionary.value_or(others.dictionary),
            .length_m = length_m.value_or(others.length_m),
            .reference = reference ? reference : others.reference};
  }
};

/// Corners in detector order: top-left first, clockwise as seen on the print. In the marker's own
/// frame (x right, y up on the print, z out of it) they are (-,+), (+,+), (+,-), (-,-) times
/// length/2.
using MarkerCorners = std::array<Eigen::Vector3d, 4>;  ///< metres
using ImageCorners =
    std::array<Eigen::Vector2d, 4>;  ///< pixels, centres at integers, as seen (distorted)

/// Centre of four corners, in an image or in space.
template <typename Point>
[[nodiscard]] Point CentreOf(const std::array<Point, 4>& corners) {
  return 0.25 * (corners[0] + corners[1] + corners[2] + corners[3]);
}
/// Mean length of the four sides.
template <typename Point>
[[nodiscard]] double MeanSide(const std::array<Point, 4>& corners) {
  double sum = 0.0;
  for (std::size_t i = 0; i < 4; ++i) sum += (corners[(i + 1) % 4] - corners[i]).norm();
  return sum / 4.0;
}

/// One marker in one image.
struct MarkerObservation {
  int id = 0;
  ImageCorners corners;
  std::array<double, 4> sigma_px = {
      0.3, 0.3, 0.3, 0.3};  ///< Standard deviation of each corner per coordinate, pixels.
};

/// Corners of a marker of the given side length in its own frame, in detector order.
/// @throws std::invalid_argument unless the length is positive: options whose length was never set
///         must not place markers.
[[nodiscard]] inline MarkerCorners CornersInMarkerFrame(double length_m) {
  if (!(length_m > 0)) throw std::invalid_argument("the side length of the markers is not set");
  const double h = length_m / 2.0;
  return {Eigen::Vector3d(-h, h, 0), Eigen::Vector3d(h, h, 0), Eigen::Vector3d(h, -h, 0),
          Eigen::Vector3d(-h, -h, 0)};
}

/// A marker's corners in a scene, with their uncertainty.
struct SceneMarker {
  MarkerCorners corners;  ///< In the scene frame.
  int num_views = 0;      ///< Keyframes (or frames) that contributed.
  /// Standard deviation of one corner coordinate, metres, root mean square over the marker's
  /// corners and their coordinates. It is what an alignment of two scenes has to expect: an error
  /// that a rigid motion of the whole map would correct does not count, so the error of the scene's
  /// frame does not count either. Preset `best`: from the joint solve's covariance,
  /// see MarkerSigmas(). Preset `paper`: the observed scatter of the views over the square root of
  /// their number.
  double sigma_m = 0.001;
};

using MarkerMap = std::map<int, SceneMarker>;  ///< by id

}  // namespace plumb
