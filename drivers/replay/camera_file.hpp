// SPDX-License-Identifier: Apache-2.0
// camera.yaml of a recording: the camera and the markers of the scene.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "algo/base/intrinsics.hpp"
#include "algo/base/pose.hpp"
#include "algo/sensor_model/depth_noise.hpp"
#include "algo/types/frame.hpp"
#include "algo/types/marker.hpp"

namespace plumb {

/// The depth camera of depth images that are not registered to the colour images.
struct DepthCamera {
  Intrinsics intrinsics;
  Pose T_color_depth = Pose::Identity();  ///< From the depth camera's frame to the colour camera's.
};

/// The keys of camera.yaml that state a depth camera of its own.
inline constexpr std::array kDepthCameraKeys = {"depth_camera_matrix",
                                                "depth_distortion_coefficients", "T_color_depth",
                                                "depth_image_width", "depth_image_height"};

/// What may stand under `assumed`: the keys whose values nothing stated when the file was written.
inline constexpr const char* kAssumedCamera = "camera_matrix";
inline constexpr const char* kAssumedDepthUnit = "depth_scale";
inline constexpr const char* kAssumedDepthCamera = "depth_registered";

/// The validated contents of camera.yaml.
struct CameraFile {
  Intrinsics color;
  bool color_assumed = false;  ///< By the program that wrote the file; likewise the next two.
  bool depth_unit_assumed = false;
  bool depth_camera_estimated = false;      ///< Depth was registered with a camera from its images.
  std::optional<double> depth_scale;        ///< Units of a depth image per metre.
  std::optional<DepthCamera> depth_camera;  ///< Set only if the depth is not registered.
  bool depth_camera_unknown =
      false;  ///< Depth is not registered, and the file does not state the depth camera.
  StatedMarkers room_markers = {};
  std::optional<DepthSensor> depth_sensor;
  std::optional<DepthNoise> depth_noise;
  std::optional<UsableDepth> usable_depth;
  std::vector<Message> warnings;
};

/// Reads OpenCV's FileStorage YAML. A key that is not read is refused with the nearest known one,
/// but for those that calibration programs write beside them. Keys: image_width, image_height,
/// camera_matrix, distortion_coefficients, distortion_model (ROS's name), depth_scale,
/// depth_registered, marker_dictionary, marker_length (metres), reference_marker,
/// depth_sensor (a class of DepthSensor), depth_noise (a map with each member of DepthNoise),
/// depth_range (nearest and farthest usable depth, metres); for depth_registered 0 also
/// depth_camera_matrix, depth_distortion_coefficients, T_color_depth (4x4) and, if they differ from
/// the colour image's, depth_image_width and depth_image_height. Without the first three of these
/// the depth camera is unknown, with a warning; any of the five without depth_registered is
/// refused. assumed: a list of camera_matrix, depth_scale and depth_registered, whose values the
/// writer of the file had assumed.
/// @param name  Name of the file for messages.
/// @throws DataError naming file, key, what was found and what is expected.
[[nodiscard]] CameraFile ParseCameraFile(std::string_view text, const std::string& name);

/// Takes over what the file states; the rest of `info` stays. Warnings are appended.
void TakeOver(const CameraFile& camera, StreamInfo& info);

}  // namespace plumb
