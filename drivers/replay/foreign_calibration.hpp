// SPDX-License-Identifier: Apache-2.0
// The camera from calibration files of other programs.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include <opencv2/core/types.hpp>

#include "drivers/replay/camera_file.hpp"

namespace plumb {

struct ForeignCalibration {
  CameraFile camera;
  std::string program;          ///< Whose format it is, such as "ORB-SLAM".
  std::string file;             ///< Its name.
  std::string depth_file = {};  ///< Of another file that states another camera for depth.
  std::optional<double> rate_hz;
  std::string sensor_name, serial;  ///< Empty where the file does not state them.
};

/// Reads the text of a calibration file: ORB-SLAM's and ORB-SLAM3's settings, Open3D's
/// camera_intrinsic.json and intrinsic.json (matrix by columns), JSON with fx, fy, cx and cy at its
/// top level (BOP, ViSP and many scripts), what ROS and RTAB-Map write (camera.yaml's keys), and
/// texts of 4, 9 or 16 numbers (fx fy cx cy, or a matrix by rows). The camera is scaled to the size
/// of the images if it is for another one of the same shape.
/// @param width, height  Of the colour images.
/// @return nothing if the text is of none of these formats.
/// @throws DataError if it is of one, but cannot be used: a fisheye lens, another shape of image.
[[nodiscard]] std::optional<ForeignCalibration> ParseForeignCalibration(std::string_view text,
                                                                        const std::string& name,
                                                                        int width, int height);

/// The calibration in the folder, if there is one: a file for the colour camera before others.
/// Files that are too large for a calibration are skipped. If a file for depth states another
/// camera, or depth has another size, the depth camera is unknown.
/// @param color, depth  Sizes of the images.
/// @throws DataError also if several files state different cameras, and if only a depth camera is
/// stated whose images have another size than colour's.
[[nodiscard]] std::optional<ForeignCalibration> FindForeignCalibration(
    const std::filesystem::path& folder, const cv::Size& color, const cv::Size& depth);

}  // namespace plumb
