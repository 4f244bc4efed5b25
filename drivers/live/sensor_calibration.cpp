// SPDX-License-Identifier: Apache-2.0
#include "drivers/live/sensor_calibration.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/replay/camera_file.hpp"
#include "words/sensor.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMaxFileBytes = std::size_t{1} << 16;

CameraFile ParseCalibration(const std::string& text, const std::string& name, int width,
                            int height) {
  CameraFile camera = ParseCameraFile(text, name);
  if (camera.color.width * height != camera.color.height * width) {
    throw DataError(
        say::sensor::CalibrationSize(name, camera.color.width, camera.color.height, width, height));
  }
  if (camera.depth_camera) {
    camera.depth_camera.reset();
    camera.warnings.push_back(say::sensor::RegistersItself(name));
  }
  return camera;
}

/// The room's markers take precedence over a sensor's file: the side length of a marker is the
/// scale of everything, and the reference marker is the frame of every plan.
void RefuseOtherMarkers(const SensorSettings& room, const CameraFile& camera,
                        const std::string& file) {
  const auto refuse = [&](const char* key, const char* setting, const Message& found,
                          const Message& expected) {
    throw DeviceError(say::sensor::OtherMarkers(file, key, found, expected, setting));
  };
  const auto length = [](double side_m) { return say::sensor::Length(side_m); };
  const auto id = [](int marker) { return Message::Verbatim(std::to_string(marker)); };
  if (camera.room_markers.dictionary &&
      *camera.room_markers.dictionary != room.room_markers.dictionary)
    refuse("marker_dictionary", "markers.dictionary",
           Message::Verbatim(*camera.room_markers.dictionary),
           Message::Verbatim(room.room_markers.dictionary));
  constexpr double kSame_m = 1e-9;
  if (camera.room_markers.length_m &&
      !(std::abs(*camera.room_markers.length_m - room.room_markers.length_m) < kSame_m))
    refuse("marker_length", "markers.length_m", length(*camera.room_markers.length_m),
           length(room.room_markers.length_m));
  if (camera.room_markers.reference && camera.room_markers.reference != room.room_markers.reference)
    refuse("reference_marker", "markers.reference", id(*camera.room_markers.reference),
           room.room_markers.reference ? id(*room.room_markers.reference)
                                       : say::sensor::NoneConfigured());
}

/// What holds where no calibration file states anything else.
StreamInfo ConfiguredInfo(const SensorSettings& settings, const KnownDepth& known) {
  StreamInfo info;
  info.depth_sensor = known.sensor;
  info.depth_noise = known.noise;
  info.usable_depth = known.range;
  info.room_markers = settings.room_markers;
  return info;
}

/// Result of `read`; a DataError becomes a DeviceError of the sensor, with advice.
template <typename Read>
auto ForSensor(const std::string& serial, Read&& read) try {
  return read();
} catch (const DataError& error) {
  throw DeviceError(say::sensor::CalibrationUnusable(serial, MessageOf(error)));
}

/// The text of a unit's file; nothing if there is none.
std::optional<std::string> TextOfUnit(const SensorSettings& settings, const std::string& serial) {
  const std::filesystem::path file = CalibrationFile(settings.calibration_folder, serial);
  std::error_code error;
  if (settings.calibration_folder.empty() ||
      !std::filesystem::exists(std::filesystem::symlink_status(file, error)))
    return std::nullopt;
  return ForSensor(serial, [&] { return ReadTextFile(file, kMaxFileBytes); });
}

}  // namespace

KnownDepth KnownOfClass(DepthSensor sensor) {
  const DepthSensorClass& of_class = ClassOf(sensor);
  return {.sensor = sensor, .noise = of_class.noise, .range = of_class.range};
}

std::filesystem::path CalibrationFile(const std::filesystem::path& folder,
                                      const std::string& serial) {
  std::string name = serial.substr(0, 100);
  const auto is_plain = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_';
  };
  std::replace_if(
      name.begin(), name.end(), [&](char c) { return !is_plain(c); }, '_');
  return folder / (name + ".yaml");
}

StreamInfo CalibratedStreamInfo(const SensorSettings& settings, const std::string& text,
                                const std::string& name, const std::string& serial, int width,
                                int height, const KnownDepth& known) {
  CameraFile camera =
      ForSensor(serial, [&] { return ParseCalibration(text, name, width, height); });
  if (settings.markers_are_the_rooms) RefuseOtherMarkers(settings, camera, name);
  // The class that the driver knows anyway does not replace what it knows of the model.
  if (camera.depth_sensor == known.sensor) camera.depth_sensor.reset();
  StreamInfo info = ConfiguredInfo(settings, known);
  TakeOver(camera, info);
  info.intrinsics = Resized(camera.color, width, height);
  return info;
}

StreamInfo LiveStreamInfo(const SensorSettings& settings, const std::string& serial, int width,
                          int height, double horizontal_fov_rad, const KnownDepth& known) {
  const std::filesystem::path file = CalibrationFile(settings.calibration_folder, serial);
  if (const std::optional<std::string> text = TextOfUnit(settings, serial))
    return CalibratedStreamInfo(settings, *text, file.string(), serial, width, height, known);
  StreamInfo info = ConfiguredInfo(settings, known);
  info.intrinsics = Resized(Intrinsics{}, width, height);
  if (horizontal_fov_rad > 0.2 && horizontal_fov_rad < 2.5)
    info.intrinsics.fx = info.intrinsics.fy = 0.5 * width / std::tan(0.5 * horizontal_fov_rad);
  info.intrinsics_assumed = true;
  info.warnings.push_back(say::sensor::NotCalibrated(serial, file.string(), info.intrinsics.fx));
  return info;
}

std::optional<StreamInfo> StatedCalibration(const SensorSettings& settings,
                                            const std::string& serial) {
  const std::optional<std::string> text = TextOfUnit(settings, serial);
  if (!text) return std::nullopt;
  const std::string name = CalibrationFile(settings.calibration_folder, serial).string();
  const Intrinsics camera = ForSensor(serial, [&] { return ParseCameraFile(*text, name).color; });
  return CalibratedStreamInfo(settings, *text, name, serial, camera.width, camera.height);
}

}  // namespace plumb
