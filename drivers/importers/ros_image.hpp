// SPDX-License-Identifier: Apache-2.0
// The messages of ROS that state cameras and images.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>
#include <opencv2/core/mat.hpp>

#include "algo/base/message.hpp"
#include "drivers/importers/ros_reader.hpp"

namespace plumb {

/// Text of a file for facts: short and printable.
[[nodiscard]] std::string Printable(std::string_view text);

/// sensor_msgs/CameraInfo, as far as it is needed.
struct RosCamera {
  std::uint32_t width = 0, height = 0;
  std::string model;
  std::vector<double> distortion;
  std::array<double, 9> matrix{};
  std::array<double, 9> rectification{};  ///< R: how the rectified image's camera is turned.
  std::array<double, 9> rectified{};      ///< P without its last column: that camera's matrix.
};
/// @throws DataError, as everything below.
[[nodiscard]] RosCamera ParseRosCamera(RosReader reader);

/// The camera of images that were rectified, if those before had a lens.
/// @throws DataError if the camera_info does not state one that looks the same way.
[[nodiscard]] RosCamera Rectified(RosCamera camera, const Message& what);

/// The lens as camera.yaml has it. librealsense projects with its "inverse" and "modified" models
/// as OpenCV does, but for the order of the last two terms.
[[nodiscard]] std::vector<double> LensOf(const RosCamera& camera, const Message& what);

/// sensor_msgs/Image or sensor_msgs/CompressedImage; a view of the message.
struct RosImage {
  double stamp_s = 0.0;
  std::string_view frame;
  std::string_view encoding;  ///< Of a packed one what its writer says of it.
  bool is_packed = false;
  std::uint32_t width = 0, height = 0, step = 0;  ///< 0 if it is packed.
  std::span<const std::uint8_t> data;
};
[[nodiscard]] RosImage ParseRosImage(RosReader reader, bool is_packed);

/// Whether the pixels are brightness by ROS's convention (REP 118), though some drivers name depth
/// so.
[[nodiscard]] bool IsNamedGrey(const RosImage& image);
/// What the image is; nothing if it is of no kind that is read.
enum class RosImageKind { kColor, kDepth, kDepthInMetres };
[[nodiscard]] std::optional<RosImageKind> KindOf(const RosImage& image);

/// CV_8UC3, red, green, blue.
[[nodiscard]] cv::Mat ColorOf(const RosImage& image);
/// CV_16UC1: units as stored; of floats, kUnitsPerMetre.
[[nodiscard]] cv::Mat DepthOf(const RosImage& image);
/// 0.2 mm, and 13 m.
inline constexpr double kUnitsPerMetre = 5000.0;

}  // namespace plumb
