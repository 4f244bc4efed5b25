#include "drivers/replay/camera_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "algo/base/errors.hpp"
#include "algo/types/marker_dictionary.hpp"
#include "drivers/files/image_file.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMaxText = std::size_t{1} << 16;
constexpr int kMaxNesting = 8;  // a calibration needs two levels
constexpr double kMaxMarkerLength_m = 2.0;
constexpr double kMaxDistortion = 100.0;
constexpr double kMinDepthScale = 10.0;  // a smaller value means that metres per unit were entered
constexpr double kMaxDepthScale = 1e6;
constexpr double kMaxBaseline_m = 1.0;
constexpr int kMaxMarkerId = 65535;

/// Refuses texts whose nesting would exhaust the parser's stack.
void CheckText(std::string_view text, const std::string& name) {
  if (text.size() > kMaxText)
    throw DataError(
        fmt::format("{} has {} bytes, at most {} are read", name, text.size(), kMaxText));
  if (text.find('\0') != std::string_view::npos)
    throw DataError(fmt::format("{} holds zero bytes: it is not text", name));
  int depth = 0;
  int dashes = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '[' || c == '{') ++depth;
    if ((c == ']' || c == '}') && depth > 0) --depth;
    if (c == '-' && i + 1 < text.size() && (text[i + 1] == ' ' || text[i + 1] == '\t')) {
      ++dashes;  // "- - - x" nests without brackets; a line of dashes does not
    } else if (c != ' ' && c != '\t') {
      dashes = 0;
    }
    if (depth > kMaxNesting || dashes > kMaxNesting)
      throw DataError(fmt::format("{} nests deeper than {} levels", name, kMaxNesting));
  }
}

/// The text as plain YAML: OpenCV's header `%YAML:1.0` is not a YAML directive.
std::string WithoutHeader(std::string_view text) {
  while (text.starts_with('%'))
    text.remove_prefix(
        std::min(text.size(), text.find('\n') == text.npos ? text.size() : text.find('\n') + 1));
  return std::string(text);
}

/// The keys of one file, typed and with messages. Read by yaml-cpp, because OpenCV's own reader
/// never returns on some broken texts.
class Keys {
 public:
  Keys(std::string_view text, std::string name) : name_(std::move(name)) {
    CheckText(text, name_);
    try {
      root_ = YAML::Load(WithoutHeader(text));
    } catch (const YAML::Exception& error) {
      throw DataError(
          fmt::format("{} cannot be parsed as YAML: {}", name_, FirstLine(error.what())));
    }
    if (!root_.IsMap())
      throw DataError(fmt::format(
          "{} holds no keys; expected OpenCV YAML as its FileStorage writes it", name_));
  }

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] bool has(const char* key) const {
    return root_[key].IsDefined() && !root_[key].IsNull();
  }
  [[nodiscard]] std::string Where(const char* key) const {
    return fmt::format("{}: {}", name_, key);
  }

  [[nodiscard]] double Number(const char* key) const { return Number(Required(key), key); }

  [[nodiscard]] int Integer(const char* key) const {
    const double value = Number(key);
    if (value != std::floor(value) || std::abs(value) > 1e9) {
      throw DataError(fmt::format("{} is {}, expected a whole number", Where(key), value));
    }
    return static_cast<int>(value);
  }

  [[nodiscard]] std::string Text(const char* key) const {
    const YAML::Node node = Required(key);
    if (!node.IsScalar()) throw DataError(fmt::format("{} is not text", Where(key)));
    return node.Scalar();
  }

  /// The elements of a matrix, row by row: an !!opencv-matrix, or a plain list.
  [[nodiscard]] std::vector<double> Matrix(const char* key) const {
    const YAML::Node node = Required(key);
    const YAML::Node data = node.IsMap() ? node["data"] : node;
    if (!data.IsDefined() || !data.IsSequence() || data.size() > 64)
      throw DataError(fmt::format("{} is not a matrix of numbers", Where(key)));
    std::vector<double> values;
    for (const YAML::Node& element : data) values.push_back(Number(element, key));
    return values;
  }

  /// The numbers of a map that has these keys and no others.
  template <std::size_t N>
  [[nodiscard]] std::array<double, N> Numbers(const char* key,
                                              const std::array<const char*, N>& names) const {
    const YAML::Node node = Required(key);
    bool fits = node.IsMap() && node.size() == N;
    for (const char* name : names) fits = fits && node[name].IsDefined();
    if (!fits)
      throw DataError(fmt::format("{} does not hold what is expected: the keys {}, one number each",
                                  Where(key), fmt::join(names, ", ")));
    std::array<double, N> values{};
    for (std::size_t i = 0; i < N; ++i)
      values[i] = Number(node[names[i]], fmt::format("{}: {}", key, names[i]).c_str());
    return values;
  }

 private:
  static std::string FirstLine(std::string text) {
    return text.substr(0, std::min<std::size_t>(text.find('\n'), 200));
  }

  [[nodiscard]] YAML::Node Required(const char* key) const {
    if (!has(key)) throw DataError(fmt::format("{} is missing", Where(key)));
    return root_[key];
  }

  [[nodiscard]] double Number(const YAML::Node& node, const char* key) const {
    const std::string text = node.IsScalar() ? node.Scalar() : std::string();
    const char* begin = text.data() + (text.starts_with('+') ? 1 : 0);
    const char* end = text.data() + text.size();
    double value = 0;
    const auto [stop, error] = std::from_chars(begin, end, value);
    if (begin == end || stop != end || error != std::errc() || !std::isfinite(value)) {
      throw DataError(
          fmt::format("{} holds {}, expected finite numbers", Where(key),
                      text.empty() ? "something else" : '"' + text.substr(0, 60) + '"'));
    }
    return value;
  }

  std::string name_;
  YAML::Node root_;  // Only read: operator[] of a const node adds nothing.
};

void ReadCameraMatrix(const Keys& keys, const char* key, Intrinsics& intrinsics) {
  const std::vector<double> k = keys.Matrix(key);
  if (k.size() != 9)
    throw DataError(fmt::format("{} has {} elements, expected 3x3", keys.Where(key), k.size()));
  if (!(k[0] > 0 && k[4] > 0)) {
    throw DataError(fmt::format(
        "{} has focal lengths {} and {}, expected both > 0 pixels; calibrate the camera",
        keys.Where(key), k[0], k[4]));
  }
  if (k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1) {
    throw DataError(fmt::format("{} is [{}], expected [fx 0 cx, 0 fy cy, 0 0 1]", keys.Where(key),
                                fmt::join(k, " ")));
  }
  intrinsics.fx = k[0];
  intrinsics.fy = k[4];
  intrinsics.cx = k[2];
  intrinsics.cy = k[5];
  // A principal point outside the image, or a view narrower than 5 deg or wider than 150 deg,
  // belongs to another image size.
  const auto fits = [](double f, double c, int size) {
    return c > 0 && c < size && f > size * 0.13 && f < size * 12.0;
  };
  if (!fits(k[0], k[2], intrinsics.width) || !fits(k[4], k[5], intrinsics.height)) {
    throw DataError(
        fmt::format("{} (fx {} fy {} cx {} cy {}) does not fit an image of {}x{}; was it "
                    "calibrated at another size?",
                    keys.Where(key), k[0], k[4], k[2], k[5], intrinsics.width, intrinsics.height));
  }
}

void ReadDistortion(const Keys& keys, const char* key, Intrinsics& intrinsics) {
  const std::vector<double> d = keys.Matrix(key);
  const bool only_five =
      d.size() >= 4 && std::all_of(d.begin() + std::min<std::ptrdiff_t>(5, std::ssize(d)), d.end(),
                                   [](double value) { return value == 0; });
  if (!only_five) {
    throw DataError(fmt::format(
        "{} has {} elements, expected the five k1 k2 p1 p2 k3 of OpenCV's plain lens model",
        keys.Where(key), d.size()));
  }
  for (std::size_t i = 0; i < std::min<std::size_t>(5, d.size()); ++i) {
    if (std::abs(d[i]) > kMaxDistortion)
      throw DataError(fmt::format("{} holds {}, which is not a plausible lens coefficient",
                                  keys.Where(key), d[i]));
    intrinsics.distortion[i] = d[i];
  }
  // A lens model must be one-to-one over the whole image, or pixels cannot be converted to rays.
  for (const double x : {0.0, 0.25, 0.75, 1.0}) {
    for (const double y : {0.0, 0.25, 0.75, 1.0}) {
      const Eigen::Vector2d pixel(x * (intrinsics.width - 1), y * (intrinsics.height - 1));
      const Eigen::Vector2d ray = Undistort(intrinsics, pixel);
      const double error_px = (Project(intrinsics, ray.homogeneous()) - pixel).norm();
      if (!(error_px < 0.5)) {
        throw DataError(fmt::format(
            "{} cannot be undone at pixel ({:.0f}, {:.0f}); is it for this camera and image size?",
            keys.Where(key), pixel.x(), pixel.y()));
      }
    }
  }
}

void CheckSize(const Keys& keys, const Intrinsics& intrinsics, const char* what) {
  if (intrinsics.width >= 1 && intrinsics.height >= 1 && intrinsics.width <= kMaxImageSide &&
      intrinsics.height <= kMaxImageSide)
    return;
  throw DataError(fmt::format("{}: the {} image is {}x{} pixels, expected 1 to {} pixels per side",
                              keys.name(), what, intrinsics.width, intrinsics.height,
                              kMaxImageSide));
}

Pose ReadRigid(const Keys& keys, const char* key) {
  const std::vector<double> m = keys.Matrix(key);
  if (m.size() != 16)
    throw DataError(fmt::format("{} has {} elements, expected 4x4", keys.Where(key), m.size()));
  const Eigen::Matrix4d matrix =
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(m.data());
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  constexpr double kTolerance = 1e-3;
  const bool rigid =
      (rotation * rotation.transpose()).isApprox(Eigen::Matrix3d::Identity(), kTolerance) &&
      rotation.determinant() > 0 &&
      matrix.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1), kTolerance);
  const Eigen::Vector3d translation_m = matrix.topRightCorner<3, 1>();
  if (!rigid || translation_m.norm() > kMaxBaseline_m) {
    throw DataError(fmt::format(
        "{} is not a rigid transform of less than {} m; expected [R t; 0 0 0 1] in metres",
        keys.Where(key), kMaxBaseline_m));
  }
  Pose T = Pose::Identity();
  T.linear() = rotation;
  T.translation() = translation_m;
  return Orthonormalised(T);
}

void ReadDepthCamera(const Keys& keys, CameraFile& camera) {
  if (!keys.has("depth_registered")) return;
  const int registered = keys.Integer("depth_registered");
  if (registered != 0 && registered != 1) {
    throw DataError(
        fmt::format("{} is {}, expected 0 or 1", keys.Where("depth_registered"), registered));
  }
  if (registered == 1) return;
  if (!keys.has("depth_camera_matrix") || !keys.has("depth_distortion_coefficients") ||
      !keys.has("T_color_depth")) {
    camera.warnings.push_back(
        fmt::format("{}: depth_registered is 0 but depth_camera_matrix, "
                    "depth_distortion_coefficients and T_color_depth are not all given; "
                    "depth is taken as registered to colour, unless the images show otherwise",
                    keys.name()));
    camera.depth_camera_unknown = true;
    return;
  }
  DepthCamera depth;
  depth.intrinsics.width =
      keys.has("depth_image_width") ? keys.Integer("depth_image_width") : camera.color.width;
  depth.intrinsics.height =
      keys.has("depth_image_height") ? keys.Integer("depth_image_height") : camera.color.height;
  CheckSize(keys, depth.intrinsics, "depth");
  ReadCameraMatrix(keys, "depth_camera_matrix", depth.intrinsics);
  ReadDistortion(keys, "depth_distortion_coefficients", depth.intrinsics);
  depth.T_color_depth = ReadRigid(keys, "T_color_depth");
  camera.depth_camera = depth;
}

void ReadDepthNoise(const Keys& keys, CameraFile& camera) {
  constexpr const char* kKey = "depth_noise";
  if (!keys.has(kKey)) return;
  constexpr std::array<const char*, 5> kNames = {"constant_m", "linear_m_per_m",
                                                 "quadratic_m_per_m2", "origin_m", "grazing_m"};
  const std::array<double, 5> values = keys.Numbers(kKey, kNames);
  const DepthNoise noise = {.constant_m = values[0],
                            .linear_m_per_m = values[1],
                            .quadratic_m_per_m2 = values[2],
                            .origin_m = values[3],
                            .grazing_m = values[4]};
  if (const std::optional<std::string> fault = FaultOf(noise)) {
    throw DataError(fmt::format(
        "{}: {}; state one standard deviation of the depth in metres, or remove the key for the "
        "noise of structured light",
        keys.Where(kKey), *fault));
  }
  camera.depth_noise = noise;
}

void ReadMarkers(const Keys& keys, CameraFile& camera) {
  if (keys.has("marker_dictionary")) {
    const std::string name = keys.Text("marker_dictionary");
    const std::optional<MarkerDictionary> dictionary = MarkerDictionary::Find(name);
    if (!dictionary) {
      throw DataError(fmt::format("{} is \"{}\", expected one of {}",
                                  keys.Where("marker_dictionary"), name.substr(0, 60),
                                  fmt::join(MarkerDictionary::KnownNames(), ", ")));
    }
    camera.marker_dictionary = dictionary->name();
  }
  if (keys.has("marker_length")) {
    camera.marker_length_m = keys.Number("marker_length");
    if (!(*camera.marker_length_m > 0 && *camera.marker_length_m < kMaxMarkerLength_m)) {
      throw DataError(fmt::format(
          "{} is {} m, expected more than 0 and less than {} m (the side of the black square)",
          keys.Where("marker_length"), *camera.marker_length_m, kMaxMarkerLength_m));
    }
  }
  if (keys.has("reference_marker")) {
    camera.reference_marker = keys.Integer("reference_marker");
    if (*camera.reference_marker < 0 || *camera.reference_marker > kMaxMarkerId) {
      throw DataError(fmt::format("{} is {}, expected a marker id from 0 to {}",
                                  keys.Where("reference_marker"), *camera.reference_marker,
                                  kMaxMarkerId));
    }
  }
}

}  // namespace

CameraFile ParseCameraFile(std::string_view text, const std::string& name) try {
  const Keys keys(text, name);
  CameraFile camera;
  camera.color.width = keys.Integer("image_width");
  camera.color.height = keys.Integer("image_height");
  CheckSize(keys, camera.color, "colour");
  ReadCameraMatrix(keys, "camera_matrix", camera.color);
  if (keys.has("distortion_coefficients")) {
    ReadDistortion(keys, "distortion_coefficients", camera.color);
  } else {
    camera.warnings.push_back(fmt::format(
        "{} has no distortion_coefficients: the lens is assumed to be free of distortion", name));
  }
  if (keys.has("depth_scale")) {
    camera.depth_scale = keys.Number("depth_scale");
    if (!(camera.depth_scale >= kMinDepthScale && camera.depth_scale <= kMaxDepthScale)) {
      throw DataError(fmt::format(
          "{} is {}, expected units per metre from {} to {} (1000 for millimetres)",
          keys.Where("depth_scale"), camera.depth_scale, kMinDepthScale, kMaxDepthScale));
    }
  }
  ReadDepthCamera(keys, camera);
  ReadDepthNoise(keys, camera);
  ReadMarkers(keys, camera);
  return camera;
} catch (const YAML::Exception& error) {
  throw DataError(
      fmt::format("{} cannot be read as YAML: {}", name, std::string(error.what()).substr(0, 200)));
}

void TakeOver(const CameraFile& camera, StreamInfo& info) {
  info.intrinsics = camera.color;
  if (camera.depth_noise) info.depth_noise = *camera.depth_noise;
  if (camera.marker_dictionary) info.marker_dictionary = *camera.marker_dictionary;
  if (camera.marker_length_m) info.marker_length_m = *camera.marker_length_m;
  if (camera.reference_marker) info.reference_marker = camera.reference_marker;
  info.warnings.insert(info.warnings.end(), camera.warnings.begin(), camera.warnings.end());
}

}  // namespace plumb
