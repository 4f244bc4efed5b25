// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/tum_writer.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/replay/camera_file.hpp"
#include "drivers/replay/tum_index.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr double kMaxUnits = 65534.0;  // 65535 is read as "nothing measured"

void MakeFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directory(folder, error);
  if (error) throw IoError(DescribeWriteError(folder, error.value()));
}

/// Shortest text that is read back as the same number, always with a point or an exponent, by which
/// FileStorage distinguishes types.
std::string Real(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".en") == std::string::npos) text += '.';
  return text;
}

cv::Mat ToUnits(const cv::Mat& depth_m, double units_per_metre) {
  cv::Mat units(depth_m.size(), CV_16UC1);
  for (int row = 0; row < depth_m.rows; ++row) {
    const auto* in = depth_m.ptr<float>(row);
    auto* out = units.ptr<std::uint16_t>(row);
    for (int column = 0; column < depth_m.cols; ++column) {
      const double value = std::round(static_cast<double>(in[column]) * units_per_metre);
      out[column] =
          value > 0 && value <= kMaxUnits ? static_cast<std::uint16_t>(value) : std::uint16_t{0};
    }
  }
  return units;
}

void CheckStamp(double time_s, std::optional<double> last_s, const char* what) {
  if (!(std::isfinite(time_s) && time_s >= 0))
    throw std::invalid_argument(
        fmt::format("{} stamp {} s must be a finite number from 0", what, time_s));
  if (last_s && !(time_s >= *last_s + kStampStep_s))
    throw std::invalid_argument(fmt::format(
        "{} stamp {:.6f} s must be later than the one before ({:.6f} s)", what, time_s, *last_s));
}

}  // namespace

EncodedFrame EncodeFrame(const Frame& frame, const TumWriterOptions& options) {
  if (frame.color_rgb.type() != CV_8UC3 || frame.depth_m.type() != CV_32FC1 ||
      frame.color_rgb.size() != frame.depth_m.size()) {
    throw std::invalid_argument(
        "EncodeFrame needs colour as CV_8UC3 and depth as CV_32FC1 of one size");
  }
  EncodedFrame encoded;
  encoded.color_time_s = frame.color_time_s;
  encoded.depth_time_s = frame.depth_time_s;
  encoded.color_file = options.jpeg_quality > 0 ? EncodeJpeg(frame.color_rgb, options.jpeg_quality)
                                                : EncodePng(frame.color_rgb);
  encoded.fewer_keypoints = frame.fewer_keypoints;
  encoded.depth_file = EncodePng(ToUnits(frame.depth_m, options.depth_scale));
  return encoded;
}

std::string CameraFileText(const StreamInfo& info, double depth_scale) {
  const Intrinsics& camera = info.intrinsics;
  std::vector<std::string> lens;
  for (const double coefficient : LensCoefficients(camera)) lens.push_back(Real(coefficient));
  std::string text = fmt::format(
      "%YAML:1.0\n---\n"
      "image_width: {}\nimage_height: {}\n"
      "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ {}, 0., {}, "
      "0., {}, {}, 0., 0., 1. ]\n"
      "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: {}\n   dt: d\n   data: [ {} "
      "]\n"
      "depth_scale: {}\ndepth_registered: {}\n",
      camera.width, camera.height, Real(camera.fx), Real(camera.cx), Real(camera.fy),
      Real(camera.cy), lens.size(), fmt::join(lens, ", "), Real(depth_scale),
      info.depth_camera_unknown ? 0 : 1);
  // Without these keys the configuration of who reads the recording holds.
  if (!info.dictionary_assumed)
    text += fmt::format("marker_dictionary: \"{}\"\n", info.room_markers.dictionary);
  if (!info.marker_length_assumed)
    text += fmt::format("marker_length: {}\n", Real(info.room_markers.length_m));
  if (info.room_markers.reference)
    text += fmt::format("reference_marker: {}\n", *info.room_markers.reference);
  const DepthSensorClass& of_class = ClassOf(info.depth_sensor);
  if (info.depth_sensor != DepthSensor::kStructuredLight)
    text += fmt::format("depth_sensor: {}\n", Name(info.depth_sensor));
  if (const UsableDepth& range = info.usable_depth; range != of_class.range)
    text += fmt::format("depth_range: [ {}, {} ]\n", Real(range.nearest_m), Real(range.farthest_m));
  if (const DepthNoise& noise = info.depth_noise; noise != of_class.noise) {
    text += fmt::format(
        "depth_noise:\n   constant_m: {}\n   linear_m_per_m: {}\n   quadratic_m_per_m2: {}\n"
        "   origin_m: {}\n   grazing_m: {}\n",
        Real(noise.constant_m), Real(noise.linear_m_per_m), Real(noise.quadratic_m_per_m2),
        Real(noise.origin_m), Real(noise.grazing_m));
  }
  std::vector<const char*> assumed;
  if (info.intrinsics_assumed) assumed.push_back(kAssumedCamera);
  if (info.depth_unit_assumed) assumed.push_back(kAssumedDepthUnit);
  if (info.depth_camera_estimated) assumed.push_back(kAssumedDepthCamera);
  if (!assumed.empty()) text += fmt::format("assumed: [ {} ]\n", fmt::join(assumed, ", "));
  return text;
}

TumWriter::TumWriter(fs::path folder, const StreamInfo& info, const TumWriterOptions& options)
    : folder_(std::move(folder)), info_(info), options_(options) {
  MakeFolder(folder_);
  MakeFolder(folder_ / "rgb");
  MakeFolder(folder_ / "depth");
  color_index_ = "# color images\n# timestamp filename\n";
  depth_index_ = "# depth maps\n# timestamp filename\n";
}

void TumWriter::Add(const EncodedFrame& frame) {
  CheckStamp(frame.color_time_s, last_color_s_, "colour");
  CheckStamp(frame.depth_time_s, last_depth_s_, "depth");
  last_color_s_ = frame.color_time_s;
  last_depth_s_ = frame.depth_time_s;
  const std::string color_name =
      fmt::format("rgb/{:.6f}.{}", frame.color_time_s, options_.jpeg_quality > 0 ? "jpg" : "png");
  const std::string depth_name = fmt::format("depth/{:.6f}.png", frame.depth_time_s);
  WriteWholeFile(folder_ / color_name, frame.color_file);
  WriteWholeFile(folder_ / depth_name, frame.depth_file);
  color_index_ += fmt::format("{:.6f} {}\n", frame.color_time_s, color_name);
  const std::string line = fmt::format("{:.6f} {}\n", frame.depth_time_s, depth_name);
  depth_index_ += line;
  if (frame.fewer_keypoints) fewer_keypoints_ += line;
}

void TumWriter::Finish() {
  WriteWholeFile(folder_ / "camera.yaml", CameraFileText(info_, options_.depth_scale));
  if (!fewer_keypoints_.empty())
    WriteWholeFile(
        folder_ / kFewerKeypointsFile,
        "# depth maps of the frames that were followed with fewer keypoints\n" + fewer_keypoints_);
  WriteWholeFile(folder_ / "depth.txt", depth_index_);
  WriteWholeFile(folder_ / "rgb.txt", color_index_);
}

}  // namespace plumb
