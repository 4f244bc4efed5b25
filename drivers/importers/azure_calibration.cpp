// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/azure_calibration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "drivers/importers/recorded_file.hpp"
#include "words/foreign.hpp"
#include "words/recording.hpp"

namespace plumb {
namespace {

using nlohmann::ordered_json;

/// The part of the sensor's image that a mode delivers.
struct AzureMode {
  int width = 0, height = 0;                ///< Delivered.
  int binned_width = 0, binned_height = 0;  ///< Of the whole sensor, at the mode's resolution.
  int left = 0, top = 0;                    ///< Where what is delivered begins in it.
};
constexpr std::array<AzureMode, 4> kDepthModes = {{{320, 288, 512, 512, 96, 90},
                                                   {640, 576, 1024, 1024, 192, 180},
                                                   {512, 512, 512, 512, 0, 0},
                                                   {1024, 1024, 1024, 1024, 0, 0}}};
constexpr std::array<AzureMode, 6> kColorModes = {{{1280, 720, 1280, 960, 0, 120},
                                                   {1920, 1080, 1920, 1440, 0, 180},
                                                   {2560, 1440, 2560, 1920, 0, 240},
                                                   {2048, 1536, 2048, 1536, 0, 0},
                                                   {3840, 2160, 3840, 2880, 0, 360},
                                                   {4096, 3072, 4096, 3072, 0, 0}}};

template <std::size_t N>
const AzureMode& ModeOf(const std::array<AzureMode, N>& modes, int width, int height) {
  const auto mode = std::ranges::find_if(
      modes, [&](const AzureMode& m) { return m.width == width && m.height == height; });
  if (mode == modes.end()) throw DataError(say::foreign::AzureMode(width, height));
  return *mode;
}

template <std::size_t N>
std::array<double, N> NumbersIn(const ordered_json& json, const char* key) {
  std::array<double, N> numbers{};
  const auto found = json.is_object() ? json.find(key) : json.end();
  if (found == json.end() || !found->is_array() || found->size() < N)
    throw DataError(say::foreign::AzureCalibration(key));
  for (std::size_t i = 0; i < N; ++i) {
    if (!(*found)[i].is_number()) throw DataError(say::foreign::AzureCalibration(key));
    numbers[i] = (*found)[i].template get<double>();
  }
  return numbers;
}

const ordered_json& PartOf(const ordered_json& json, const char* key) {
  const auto found = json.is_object() ? json.find(key) : json.end();
  if (found == json.end()) throw DataError(say::foreign::AzureCalibration(key));
  return *found;
}

/// The camera for a purpose: its matrix and its lens as camera.yaml has them, and where it is.
struct AzureOptics {
  std::array<double, 9> matrix{};
  std::array<double, 8> lens{};
  Eigen::Isometry3d T_camera_device = Eigen::Isometry3d::Identity();
};

AzureOptics OpticsOf(const ordered_json& cameras, const char* purpose, const AzureMode& mode,
                     const Message& what) {
  const auto camera = std::ranges::find_if(cameras, [&](const ordered_json& one) {
    return one.is_object() && one.value("Purpose", ordered_json()) == purpose;
  });
  if (camera == cameras.end()) throw DataError(say::foreign::IntrinsicsMissing(what));
  // Centre and focal length as parts of the sensor's image; k1 to k6, the centre of the distortion,
  // and the tangential terms, of which the second comes first.
  const auto p = NumbersIn<14>(PartOf(*camera, "Intrinsics"), "ModelParameters");
  if (p[10] != 0 || p[11] != 0) throw DataError(say::foreign::LensModel(what, "Rational6KT, codx"));
  AzureOptics optics;
  // There the first pixel begins at 0; here its centre is at 0.
  optics.matrix = {p[2] * mode.binned_width,
                   0.0,
                   p[0] * mode.binned_width - mode.left - 0.5,
                   0.0,
                   p[3] * mode.binned_height,
                   p[1] * mode.binned_height - mode.top - 0.5,
                   0.0,
                   0.0,
                   1.0};
  // The device's newer model has no factor of 2 in the tangential terms: below 0.1 px.
  optics.lens = {p[4], p[5], p[13], p[12], p[6], p[7], p[8], p[9]};
  const ordered_json& placed = PartOf(*camera, "Rt");
  const auto turn = NumbersIn<9>(placed, "Rotation");
  const auto t_m = NumbersIn<3>(placed, "Translation");
  Eigen::Matrix3d rotation;
  for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = turn[static_cast<std::size_t>(i)];
  optics.T_camera_device = Eigen::Translation3d(t_m[0], t_m[1], t_m[2]) * RotationOf(rotation);
  return optics;
}

}  // namespace

ordered_json AzureCamera(std::string_view calibration, const AzureSizes& sizes) {
  // The attachment ends with a NUL.
  while (calibration.ends_with('\0')) calibration.remove_suffix(1);
  const auto json = ParseBoundedJsonOrNothing<ordered_json>(calibration);
  const ordered_json& cameras = PartOf(PartOf(json, "CalibrationInformation"), "Cameras");
  if (!cameras.is_array()) throw DataError(say::foreign::AzureCalibration("Cameras"));
  const AzureOptics color = OpticsOf(cameras, "CALIBRATION_CameraPurposePhotoVideo",
                                     ModeOf(kColorModes, sizes.color_width, sizes.color_height),
                                     say::recording::Colour());
  const AzureOptics depth =
      OpticsOf(cameras, "CALIBRATION_CameraPurposeDepth",
               ModeOf(kDepthModes, sizes.depth_width, sizes.depth_height), say::recording::Depth());
  const Eigen::Matrix4d T_color_depth =
      (color.T_camera_device * depth.T_camera_device.inverse()).matrix();
  std::vector<double> rows;
  for (int r = 0; r < 4; ++r)
    for (int c = 0; c < 4; ++c) rows.push_back(T_color_depth(r, c));
  return {{"image_width", sizes.color_width},
          {"image_height", sizes.color_height},
          {"camera_matrix", color.matrix},
          {"distortion_coefficients", color.lens},
          {"depth_scale", 1000.0},
          {"depth_registered", 0},
          {"depth_image_width", sizes.depth_width},
          {"depth_image_height", sizes.depth_height},
          {"depth_camera_matrix", depth.matrix},
          {"depth_distortion_coefficients", depth.lens},
          {"T_color_depth", rows},
          {"depth_sensor", "time_of_flight"}};
}

}  // namespace plumb
