// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/foreign_calibration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <vector>

#include <nlohmann/json.hpp>

#include "algo/base/ascii_lower.hpp"
#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/parse_number.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/replay/device_class.hpp"
#include "words/foreign.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr std::size_t kMaxBytes = std::size_t{1} << 16;

std::string_view Stripped(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\n";
  const std::size_t begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) - begin + 1);
}

/// What all formats state, before the shared checks of camera.yaml.
struct Stated {
  int width = 0, height = 0;  ///< 0: not stated.
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::optional<std::vector<double>> distortion = {};
  bool is_equidistant = false;  ///< The lens, with four coefficients.
  std::optional<double> units_per_metre;
};

CameraFile Checked(const Stated& stated, const std::string& name, int width, int height) {
  ordered_json keys = {
      {"image_width", stated.width > 0 ? stated.width : width},
      {"image_height", stated.height > 0 ? stated.height : height},
      {"camera_matrix", {stated.fx, 0.0, stated.cx, 0.0, stated.fy, stated.cy, 0.0, 0.0, 1.0}}};
  if (stated.distortion) keys["distortion_coefficients"] = *stated.distortion;
  if (stated.is_equidistant) keys["distortion_model"] = "equidistant";
  if (stated.units_per_metre) keys["depth_scale"] = *stated.units_per_metre;
  return ParseCameraFile(keys.dump(), name);
}

/// In units per metre. The number may be that itself, metres per unit, or (BOP) millimetres per
/// unit.
double UnitsPerMetre(double scale) {
  if (scale <= 0.01) return 1.0 / scale;
  return scale < 50.0 ? 1000.0 / scale : scale;
}

/// A number at the top level under one of several names; nothing if none is there.
std::optional<double> NumberIn(const ordered_json& json, std::initializer_list<const char*> names) {
  for (const char* name : names)
    if (const auto found = json.find(name); found != json.end() && found->is_number())
      return found->get<double>();
  return std::nullopt;
}

std::string TextIn(const ordered_json& json, const char* name) {
  const auto found = json.find(name);
  return found != json.end() && found->is_string() ? found->get<std::string>().substr(0, 64)
                                                   : std::string();
}

/// The coefficients of a lens, as a list under one of the usual names or one by one.
std::optional<std::vector<double>> LensIn(const ordered_json& camera, const std::string& name) {
  for (const char* key :
       {"coeffs", "distortion_coefficients", "distortion", "dist_coeffs", "dist", "D"}) {
    const auto found = camera.find(key);
    if (found == camera.end() || found->is_null()) continue;
    if (found->is_object()) return LensIn(*found, name);
    if (!found->is_array()) continue;
    // OpenCV's matrices become lists of one list.
    const ordered_json& list =
        found->size() == 1 && found->front().is_array() ? found->front() : *found;
    std::vector<double> lens;
    for (const auto& element : list) {
      const ordered_json& value =
          element.is_array() && element.size() == 1 ? element.front() : element;
      if (!value.is_number()) throw DataError(say::foreign::NoNumber(name, key));
      lens.push_back(value.get<double>());
    }
    return lens;
  }
  if (!camera.contains("k1")) return std::nullopt;
  const bool has_tangential = camera.contains("p1") || camera.contains("p2");
  std::vector<const char*> keys = {"k1", "k2", "p1", "p2", "k3"};
  if (camera.contains("k4") && !has_tangential) keys = {"k1", "k2", "k3", "k4"};
  if (camera.contains("k4") && has_tangential)
    keys = {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  std::vector<double> lens;
  for (const char* key : keys) {
    if (camera.contains(key) && !camera[key].is_number())
      throw DataError(say::foreign::NoNumber(name, key));
    lens.push_back(NumberIn(camera, {key}).value_or(0));
  }
  return lens;
}

/// The lens and its model, as librealsense's Python, OpenCV's users and NeRF's programs name it.
void TakeLens(const ordered_json& camera, const std::string& name, Stated& stated) {
  stated.distortion = LensIn(camera, name);
  std::string stated_model;
  for (const char* key : {"model", "distortion_model", "camera_model"})
    if (stated_model.empty()) stated_model = TextIn(camera, key);
  std::string model;
  for (const char c : AsciiLower(stated_model))
    if (c != '_' && c != ' ' && c != '-') model += c;
  const auto is_one_of = [&](std::initializer_list<std::string_view> parts) {
    return std::ranges::any_of(
        parts, [&](std::string_view part) { return model.find(part) != std::string::npos; });
  };
  stated.is_equidistant = is_one_of({"kannala", "fisheye", "equidistant"});
  if (stated.is_equidistant) {  // Without coefficients no such lens is known.
    if (!stated.distortion) throw DataError(say::foreign::LensModelOf(name, stated_model));
    if (stated.distortion->size() > 4 &&
        std::all_of(stated.distortion->begin() + 4, stated.distortion->end(),
                    [](double value) { return value == 0; }))
      stated.distortion->resize(4);
    return;
  }
  const bool bends = stated.distortion && std::ranges::any_of(*stated.distortion, [](double value) {
                       return value != 0;
                     });
  const bool is_known = model.empty() || is_one_of({"brown", "plumbbob", "radtan", "rational",
                                                    "opencv", "pinhole", "none", "radial"});
  if (bends && !is_known) throw DataError(say::foreign::LensModelOf(name, stated_model));
}

std::optional<ForeignCalibration> OfJson(std::string_view text, const std::string& name, int width,
                                         int height) {
  const auto json = ParseBoundedJsonOrNothing<ordered_json>(text);
  if (!json.is_object()) return std::nullopt;
  Stated stated;
  ForeignCalibration found;
  // Open3D wraps it so in trajectories and in the metadata of its recorder.
  const ordered_json& camera =
      json.contains("intrinsic") && json["intrinsic"].is_object() ? json["intrinsic"] : json;
  if (const auto matrix = camera.find("intrinsic_matrix"); matrix != camera.end()) {
    found.program = "Open3D";
    std::vector<double> k;
    for (const auto& element : *matrix)
      k.push_back(element.is_number() ? element.get<double>() : NAN);
    // By columns: fx 0 0, 0 fy 0, cx cy 1.
    if (k.size() != 9 || k[2] != 0 || k[5] != 0 || k[8] != 1 || k[1] != 0 || k[3] != 0)
      throw DataError(say::foreign::Open3dMatrix(name));
    stated.fx = k[0], stated.fy = k[4], stated.cx = k[6], stated.cy = k[7];
  } else {
    found.program = "JSON";
    const auto fx = NumberIn(camera, {"fx"}), fy = NumberIn(camera, {"fy"});
    const auto cx = NumberIn(camera, {"cx", "ppx"}), cy = NumberIn(camera, {"cy", "ppy"});
    if (!fx || !fy || !cx || !cy) return std::nullopt;
    stated.fx = *fx, stated.fy = *fy, stated.cx = *cx, stated.cy = *cy;
  }
  TakeLens(camera, name, stated);
  const double w = NumberIn(camera, {"width", "w", "image_width"}).value_or(0);
  const double h = NumberIn(camera, {"height", "h", "image_height"}).value_or(0);
  stated.width = w > 0 && w < 1e5 ? static_cast<int>(w) : 0;
  stated.height = h > 0 && h < 1e5 ? static_cast<int>(h) : 0;
  if (const auto scale = NumberIn(json, {"depth_scale"}); scale && *scale > 0)
    stated.units_per_metre = UnitsPerMetre(*scale);
  found.rate_hz = NumberIn(json, {"fps"});
  found.sensor_name = TextIn(json, "device_name");
  found.serial = TextIn(json, "serial_number");
  found.camera = Checked(stated, name, width, height);
  found.camera.depth_sensor = ClassOfDevice(found.sensor_name);
  return found;
}

/// ORB-SLAM's settings are lines KEY: VALUE; blocks of matrices are for stereo and passed over.
std::optional<ForeignCalibration> OfOrbSlam(std::string_view text, const std::string& name,
                                            int width, int height) {
  std::map<std::string, std::string, std::less<>> values;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    line = Stripped(line.substr(0, line.find('#')));
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos) continue;
    values.emplace(Stripped(line.substr(0, colon)), Stripped(line.substr(colon + 1)));
  }
  const std::string camera = values.contains("Camera1.fx") ? "Camera1." : "Camera.";
  if (!values.contains(camera + "fx")) return std::nullopt;
  const auto number = [&](const std::string& key, double otherwise) {
    const auto found = values.find(key);
    if (found == values.end()) return otherwise;
    const std::optional<double> value = ParseNumber<double>(found->second);
    if (!value) throw DataError(say::foreign::NoNumber(name, key));
    return *value;
  };
  Stated stated;
  stated.fx = number(camera + "fx", 0), stated.fy = number(camera + "fy", 0);
  stated.cx = number(camera + "cx", 0), stated.cy = number(camera + "cy", 0);
  const auto type = values.find("Camera.type");
  stated.is_equidistant = type != values.end() && type->second.find("Kannala") != std::string::npos;
  const std::vector<const char*> lens = stated.is_equidistant
                                            ? std::vector{"k1", "k2", "k3", "k4"}
                                            : std::vector{"k1", "k2", "p1", "p2", "k3"};
  stated.distortion.emplace();
  for (const char* coefficient : lens)
    stated.distortion->push_back(number(camera + coefficient, 0));
  stated.width = static_cast<int>(std::clamp(number("Camera.width", 0), 0.0, 1e5));
  stated.height = static_cast<int>(std::clamp(number("Camera.height", 0), 0.0, 1e5));
  const double factor = number("DepthMapFactor", number("RGBD.DepthMapFactor", 0));
  if (factor > 1) stated.units_per_metre = factor;
  ForeignCalibration found;
  found.program = "ORB-SLAM";
  if (const double rate = number("Camera.fps", 0); rate > 0) found.rate_hz = rate;
  found.camera = Checked(stated, name, width, height);
  return found;
}

/// fx fy cx cy, or a matrix of three or four rows.
std::optional<ForeignCalibration> OfNumbers(std::string_view text, const std::string& name,
                                            int width, int height) {
  std::vector<double> n;
  while (!(text = Stripped(text)).empty()) {
    const std::size_t end = std::min(text.find_first_of(" \t\r\n,"), text.size());
    const std::optional<double> value = ParseNumber<double>(text.substr(0, end));
    if (!value || !std::isfinite(*value) || n.size() == 16) return std::nullopt;
    n.push_back(*value);
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  Stated stated;
  const std::size_t row = n.size() == 16 ? 4 : 3;
  if (n.size() == 4) {
    stated.fx = n[0], stated.fy = n[1], stated.cx = n[2], stated.cy = n[3];
  } else if ((n.size() == 9 || n.size() == 16) && n[1] == 0 && n[row] == 0 && n[2 * row] == 0 &&
             n[2 * row + 1] == 0 && n[2 * row + 2] == 1) {
    stated.fx = n[0], stated.fy = n[row + 1], stated.cx = n[2], stated.cy = n[row + 2];
  } else {
    return std::nullopt;
  }
  ForeignCalibration found;
  found.program = "text";
  found.camera = Checked(stated, name, width, height);
  return found;
}

/// The camera for images of this size.
void Fit(CameraFile& camera, const std::string& name, int width, int height) {
  Intrinsics& color = camera.color;
  if (color.width == width && color.height == height) return;
  if (color.width * height != color.height * width)
    throw DataError(say::foreign::OtherShape(name, color.width, color.height, width, height));
  camera.warnings.push_back(say::foreign::Scaled(name, color.width, color.height, width, height));
  color = Resized(color, width, height);
}

/// Whether two cameras are one, within what files round.
bool IsSame(const Intrinsics& a, const Intrinsics& b) {
  constexpr double kSameFocal = 1e-3, kSameCentre_px = 0.5;
  return a.width == b.width && a.height == b.height && std::abs(a.fx / b.fx - 1) < kSameFocal &&
         std::abs(a.fy / b.fy - 1) < kSameFocal && std::abs(a.cx - b.cx) < kSameCentre_px &&
         std::abs(a.cy - b.cy) < kSameCentre_px;
}

bool IsOfDepth(const std::string& name) { return name.find("depth") != std::string::npos; }

/// Nothing for a file that is too large for a calibration or cannot be read: other programs use
/// such names for poses and labels, too.
std::optional<ForeignCalibration> ParseCandidate(const fs::path& file, const cv::Size& size) {
  std::string text;
  try {
    text = ReadTextFile(file, kMaxBytes);
  } catch (const DataError&) {
    return std::nullopt;
  }
  return ParseForeignCalibration(text, file.filename().string(), size.width, size.height);
}

/// A depth camera of its own beside the colour camera shows that depth is not registered.
void CompareDepthCamera(const fs::path& file, const cv::Size& depth, ForeignCalibration& found) {
  try {
    const auto of_depth = ParseCandidate(file, depth);
    if (!of_depth || IsSame(of_depth->camera.color, found.camera.color)) return;
  } catch (const DataError&) {
    // Of images of another shape, or damaged: it is not the colour camera either way.
  }
  found.depth_file = file.filename().string();
  found.camera.depth_camera_unknown = true;
  found.camera.warnings.push_back(
      say::foreign::TwoCameras(found.file, found.camera.color.fx, found.depth_file));
}

bool IsCandidate(const std::string& name) {
  const auto ends = [&](const char* ending) { return name.ends_with(ending); };
  const auto has = [&](const char* part) { return name.find(part) != std::string::npos; };
  return ends(".yaml") || ends(".yml") || ends(".json") ||
         (ends(".txt") && (has("camera") || has("calib") || has("intrinsic")));
}

}  // namespace

std::optional<ForeignCalibration> ParseForeignCalibration(std::string_view text,
                                                          const std::string& name, int width,
                                                          int height) {
  std::optional<ForeignCalibration> found;
  if (name.ends_with(".json")) {
    found = OfJson(text, name, width, height);
  } else if (name.ends_with(".txt")) {
    found = OfNumbers(text, name, width, height);
  } else if (text.find("camera_matrix") != std::string_view::npos &&
             text.find("image_width") != std::string_view::npos) {
    found.emplace();
    found->program = "ROS";
    found->camera = ParseCameraFile(text, name);
  } else {
    found = OfOrbSlam(text, name, width, height);
  }
  if (!found) return std::nullopt;
  found->file = name;
  Fit(found->camera, name, width, height);
  return found;
}

std::optional<ForeignCalibration> FindForeignCalibration(const fs::path& folder,
                                                         const cv::Size& color,
                                                         const cv::Size& depth) {
  std::vector<std::string> names;
  std::error_code ignored;
  for (fs::directory_iterator entry(folder, ignored), end; entry != end; entry.increment(ignored))
    if (std::string name = entry->path().filename().string();
        IsCandidate(name) && entry->is_regular_file(ignored))
      names.push_back(std::move(name));
  // The colour camera's file first, the depth camera's last: registered depth has the colour
  // camera's pixels.
  const auto rank = [](const std::string& name) {
    const auto has = [&](const char* part) { return name.find(part) != std::string::npos; };
    return IsOfDepth(name) ? 2 : has("color") || has("rgb") ? 0 : 1;
  };
  std::ranges::sort(names, {}, [&](const std::string& n) { return std::pair(rank(n), n); });
  std::optional<ForeignCalibration> found;
  for (const std::string& name : names) {
    if (found && rank(name) > rank(found->file)) break;
    const auto one = ParseCandidate(folder / name, IsOfDepth(name) ? depth : color);
    if (!one) continue;
    if (found && !(found->camera.color == one->camera.color))
      throw DataError(say::foreign::SeveralCalibrations(found->file, one->file));
    if (!found) found = one;
  }
  if (!found) return found;
  if (IsOfDepth(found->file)) {
    if (depth != color) throw DataError(say::foreign::DepthCameraAlone(found->file));
    return found;
  }
  if (found->camera.depth_camera) return found;  // stated in Plumb's own keys
  for (const std::string& name : names)
    if (IsOfDepth(name) && found->depth_file.empty())
      CompareDepthCamera(folder / name, depth, *found);
  if (depth != color) found->camera.depth_camera_unknown = true;
  return found;
}

}  // namespace plumb
