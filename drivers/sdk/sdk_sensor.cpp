// SPDX-License-Identifier: Apache-2.0
#include "drivers/sdk/sdk_sensor.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <system_error>
#include <utility>

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "algo/base/errors.hpp"
#include "drivers/live/sensor_calibration.hpp"
#include "drivers/replay/camera_file.hpp"
#include "words/recording.hpp"
#include "words/sdk.hpp"

namespace plumb {
namespace {

constexpr int kMostSdkColumns = 960;

nlohmann::json MatrixOf(const SdkLens& lens) {
  return std::array<double, 9>{lens.fx, 0, lens.cx, 0, lens.fy, lens.cy, 0, 0, 1};
}

/// The factory's calibration, in the form of camera.yaml and as strictly checked.
CameraFile FactoryCamera(const SdkFactory& factory, const SdkTitle& title,
                         const std::string& serial) try {
  if (!(factory.depth_unit_m > 0)) throw DeviceError(say::sdk::NoCalibration(serial));
  nlohmann::json rows = nlohmann::json::array();
  for (int r = 0; r < 4; ++r)
    for (int c = 0; c < 4; ++c) rows.push_back(factory.T_color_depth.matrix()(r, c));
  nlohmann::json keys = {{"image_width", factory.color.width},
                         {"image_height", factory.color.height},
                         {"camera_matrix", MatrixOf(factory.color)},
                         {"distortion_coefficients", factory.color.distortion},
                         {"depth_scale", 1.0 / factory.depth_unit_m},
                         {"depth_registered", 0},
                         {"depth_image_width", factory.depth.width},
                         {"depth_image_height", factory.depth.height},
                         {"depth_camera_matrix", MatrixOf(factory.depth)},
                         {"depth_distortion_coefficients", factory.depth.distortion},
                         {"T_color_depth", rows}};
  if (factory.color.is_equidistant) keys["distortion_model"] = "equidistant";
  return ParseCameraFile(keys.dump(), title.name);
} catch (const DataError& error) {
  throw DeviceError(say::sdk::CalibrationDamaged(serial, error.message()));
}

StreamInfo SdkInfo(const SensorSettings& settings, const SdkUnit& unit, const SdkTitle& title,
                   const CameraFile& factory) {
  const KnownDepth known = KnownOfClass(unit.depth_sensor);
  const cv::Size size = SdkColorSize(factory.color.width, factory.color.height);
  StreamInfo info;
  std::error_code error;
  if (std::filesystem::exists(CalibrationFile(settings.calibration_folder, unit.serial), error)) {
    info = LiveStreamInfo(settings, unit.serial, size.width, size.height, 0.0, known);
  } else {
    info.room_markers = settings.room_markers;
    TakeOver(factory, info);
    info.intrinsics = Resized(factory.color, size.width, size.height);
    info.depth_sensor = known.sensor;
    info.depth_noise = known.noise;
    info.usable_depth = known.range;
  }
  if (const auto advice = FirmwareAdvice(unit, title.name)) info.warnings.push_back(*advice);
  return info;
}

}  // namespace

Pose RigidPose(const Eigen::Matrix3f& turn, const Eigen::Vector3f& shift_m) {
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::Quaterniond(turn.cast<double>().eval()).normalized().toRotationMatrix();
  pose.translation() = shift_m.cast<double>();
  return pose;
}

cv::Size SdkColorSize(int width, int height) {
  return width > kMostSdkColumns ? cv::Size(width / 2, height / 2) : cv::Size(width, height);
}

std::optional<std::size_t> SdkRank(std::span<const cv::Size> sizes, int width, int height) {
  const auto known = std::ranges::find(sizes, cv::Size(width, height));
  if (known == sizes.end()) return std::nullopt;
  return static_cast<std::size_t>(known - sizes.begin());
}

bool IsWanted(FrameBox& box, const std::string& serial, const SdkImage& image, int wanted_width,
              int wanted_height) {
  const bool is_color = image.kind == StreamKind::kColor;
  const auto least = static_cast<std::size_t>(std::max(image.width, 0)) * (is_color ? 3 : 2);
  if (image.width == wanted_width && image.height == wanted_height && image.has_format &&
      image.row_bytes >= least && image.data != nullptr)
    return true;
  box.Fail(say::sdk::WrongSize(serial,
                               is_color ? say::recording::Colour() : say::recording::Depth(),
                               image.width, image.height, wanted_width, wanted_height));
  return false;
}

cv::Mat CopyOf(const SdkImage& image) {
  const bool is_color = image.kind == StreamKind::kColor;
  const cv::Mat view(image.height, image.width, is_color ? CV_8UC3 : CV_16UC1,
                     const_cast<void*>(image.data), image.row_bytes);
  const cv::Size size = is_color ? SdkColorSize(image.width, image.height) : view.size();
  if (size == view.size()) return view.clone();
  cv::Mat halved;
  cv::resize(view, halved, size, 0, 0, cv::INTER_AREA);
  return halved;
}

SdkSensor::SdkSensor(SdkOpening opening, const SensorSettings& settings, const SdkTitle& title,
                     const SdkFactory& factory)
    : BoxedSensor(std::move(opening.description), std::move(opening.box)),
      exposure_us_(settings.exposure_us),
      watched_(std::move(opening.watched)) {
  const SdkUnit& unit = opening.attached.unit;
  const CameraFile camera = FactoryCamera(factory, title, unit.serial);
  SetInfo(SdkInfo(settings, unit, title, camera));
  SetDepth(camera.depth_scale.value(),
           DepthRegistration(camera.depth_camera.value().intrinsics, info().intrinsics,
                             camera.depth_camera->T_color_depth));
}

}  // namespace plumb
