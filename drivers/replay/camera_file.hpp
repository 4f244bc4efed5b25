// camera.yaml of a recording: the camera and the markers of the scene.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "algo/base/intrinsics.hpp"
#include "algo/base/pose.hpp"
#include "algo/types/depth_noise.hpp"
#include "algo/types/frame.hpp"

namespace plumb {

/// The depth camera of depth images that are not registered to the colour images.
struct DepthCamera {
  Intrinsics intrinsics;
  Pose T_color_depth = Pose::Identity();  ///< From the depth camera's frame to the colour camera's.
};

/// The validated contents of camera.yaml.
struct CameraFile {
  Intrinsics color;
  double depth_scale = 5000.0;  ///< Units of a depth image per metre; TUM's 5000 by default.
  std::optional<DepthCamera> depth_camera;  ///< Set only if the depth is not registered.
  bool depth_camera_unknown =
      false;  ///< Depth is not registered, and the file does not state the depth camera.
  std::optional<std::string> marker_dictionary;
  std::optional<double> marker_length_m;
  std::optional<int> reference_marker;
  std::optional<DepthNoise> depth_noise;
  std::vector<std::string> warnings;
};

/// Reads OpenCV's FileStorage YAML. Keys: image_width, image_height, camera_matrix,
/// distortion_coefficients, depth_scale, depth_registered, marker_dictionary, marker_length
/// (metres), reference_marker, depth_noise (a map with each member of DepthNoise); for
/// depth_registered 0 also depth_camera_matrix, depth_distortion_coefficients, T_color_depth (4x4)
/// and, if they differ from the colour image's, depth_image_width and depth_image_height. Without
/// the first three of these the depth camera is unknown, with a warning.
/// @param name  Name of the file for messages.
/// @throws DataError naming file, key, what was found and what is expected.
[[nodiscard]] CameraFile ParseCameraFile(std::string_view text, const std::string& name);

/// Takes over what the file states; the rest of `info` stays. Warnings are appended.
void TakeOver(const CameraFile& camera, StreamInfo& info);

}  // namespace plumb
