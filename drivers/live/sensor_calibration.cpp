#include "drivers/live/sensor_calibration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/replay/camera_file.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMaxFileBytes = std::size_t{1} << 16;

CameraFile ParseCalibration(const std::string& text, const std::string& name, int width,
                            int height) {
  CameraFile camera = ParseCameraFile(text, name);
  if (camera.color.width * height != camera.color.height * width) {
    throw DataError(fmt::format("{} is for images of {}x{}, expected {}x{} or a multiple", name,
                                camera.color.width, camera.color.height, width, height));
  }
  if (camera.depth_camera) {
    camera.depth_camera.reset();
    camera.warnings.push_back(fmt::format(
        "depth_registered: 0 in {} is ignored, because the sensor registers depth itself", name));
  }
  return camera;
}

/// The room's markers take precedence over a sensor's file: the side length of a marker is the
/// scale of everything, and the reference marker is the frame of every plan.
void RefuseOtherMarkers(const SensorSettings& room, const CameraFile& camera,
                        const std::string& file) {
  const auto refuse = [&](const char* key, const char* setting, const std::string& found,
                          const std::string& expected) {
    throw DeviceError(fmt::format(
        "{}: {} is {}, but this room has {}; the markers are the room's, not the sensor's: remove "
        "the key from the file, or correct {} in the configuration",
        file, key, found, expected, setting));
  };
  if (camera.marker_dictionary && *camera.marker_dictionary != room.marker_dictionary)
    refuse("marker_dictionary", "markers.dictionary", *camera.marker_dictionary,
           room.marker_dictionary);
  constexpr double kSame_m = 1e-9;
  if (camera.marker_length_m &&
      !(std::abs(*camera.marker_length_m - room.marker_length_m) < kSame_m))
    refuse("marker_length", "markers.length_m", fmt::format("{} m", *camera.marker_length_m),
           fmt::format("{} m", room.marker_length_m));
  if (camera.reference_marker && camera.reference_marker != room.reference_marker)
    refuse("reference_marker", "markers.reference", fmt::format("{}", *camera.reference_marker),
           room.reference_marker ? fmt::format("{}", *room.reference_marker) : "none configured");
}

/// What holds where no calibration file states anything else.
StreamInfo ConfiguredInfo(const SensorSettings& settings, const DepthNoise& depth_noise) {
  StreamInfo info;
  info.depth_noise = depth_noise;
  info.marker_dictionary = settings.marker_dictionary;
  info.marker_length_m = settings.marker_length_m;
  info.reference_marker = settings.reference_marker;
  return info;
}

/// Result of `read`; a DataError becomes a DeviceError of the sensor, with advice.
template <typename Read>
auto ForSensor(const std::string& serial, Read&& read) try {
  return read();
} catch (const DataError& error) {
  throw DeviceError(
      fmt::format("the calibration of sensor {} cannot be used: {}; correct or remove the file",
                  serial, error.what()));
}

}  // namespace

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
                                int height, const DepthNoise& depth_noise) {
  const CameraFile camera =
      ForSensor(serial, [&] { return ParseCalibration(text, name, width, height); });
  if (settings.markers_are_the_rooms) RefuseOtherMarkers(settings, camera, name);
  StreamInfo info = ConfiguredInfo(settings, depth_noise);
  TakeOver(camera, info);
  info.intrinsics = Resized(camera.color, width, height);
  return info;
}

StreamInfo LiveStreamInfo(const SensorSettings& settings, const std::string& serial, int width,
                          int height, double horizontal_fov_rad, const DepthNoise& depth_noise) {
  const std::filesystem::path file = CalibrationFile(settings.calibration_folder, serial);
  std::error_code error;
  if (!settings.calibration_folder.empty() &&
      std::filesystem::exists(std::filesystem::symlink_status(file, error))) {
    return CalibratedStreamInfo(
        settings, ForSensor(serial, [&] { return ReadTextFile(file, kMaxFileBytes); }),
        file.string(), serial, width, height, depth_noise);
  }
  StreamInfo info = ConfiguredInfo(settings, depth_noise);
  info.intrinsics = Resized(Intrinsics{}, width, height);
  if (horizontal_fov_rad > 0.2 && horizontal_fov_rad < 2.5)
    info.intrinsics.fx = info.intrinsics.fy = 0.5 * width / std::tan(0.5 * horizontal_fov_rad);
  info.intrinsics_assumed = true;
  info.warnings.push_back(
      fmt::format("sensor {} is not calibrated (no {}): nominal focal length of {:.1f} pixels and "
                  "no distortion assumed",
                  serial, file.string(), info.intrinsics.fx));
  return info;
}

}  // namespace plumb
