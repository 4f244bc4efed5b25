// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/camera_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <set>

#include "algo/base/errors.hpp"
#include "algo/base/nearest_name.hpp"
#include "algo/types/marker_dictionary.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/replay/lens_model.hpp"
#include "words/recording.hpp"

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

constexpr std::array kKnownKeys = {"image_width",        "image_height",
                                   "camera_matrix",      "distortion_model",
                                   "depth_scale",        "distortion_coefficients",
                                   "depth_registered",   "depth_image_width",
                                   "depth_image_height", "depth_camera_matrix",
                                   "depth_noise",        "depth_distortion_coefficients",
                                   "T_color_depth",      "marker_dictionary",
                                   "marker_length",      "reference_marker",
                                   "sensor_serial",      "color_begin_us",
                                   "depth_begin_us",     "depth_sensor",
                                   "depth_range",        "assumed"};
// What OpenCV's calibration program, ROS (camera_info) and RTAB-Map write beside the keys that are
// read. It says nothing that Plumb would need.
constexpr std::array kOfCalibrators = {"camera_name",
                                       "rectification_matrix",
                                       "projection_matrix",
                                       "local_transform",
                                       "calibration_time",
                                       "nr_of_frames",
                                       "nframes",
                                       "board_width",
                                       "board_height",
                                       "square_size",
                                       "marker_size_of_board",
                                       "aspectRatio",
                                       "fix_aspect_ratio",
                                       "flags",
                                       "avg_reprojection_error",
                                       "fisheye_model",
                                       "per_view_reprojection_errors",
                                       "extrinsic_parameters",
                                       "image_points",
                                       "grid_points",
                                       "model_version"};
// A key that tells the file of another program, with the program's name.
constexpr std::array<std::pair<const char*, const char*>, 7> kForeignKeys = {{
    {"Camera.fx", "ORB-SLAM"},
    {"Camera1.fx", "ORB-SLAM3"},
    {"Camera.type", "ORB-SLAM"},
    {"intrinsic_matrix", "Open3D"},
    {"cam0", "Kalibr"},
    {"T_BS", "EuRoC"},
    {"camera_model", "camodocal"},
}};

// What other programs call a key of this file. By its letters, "depth_factor" is nearer to
// "depth_sensor" than to the key that is meant.
constexpr std::array<std::pair<const char*, const char*>, 16> kOtherNames = {{
    {"depth_factor", "depth_scale"},
    {"depth_map_factor", "depth_scale"},
    {"DepthMapFactor", "depth_scale"},
    {"depth_units", "depth_scale"},
    {"png_depth_scale", "depth_scale"},
    {"scale", "depth_scale"},
    {"marker_size", "marker_length"},
    {"marker_side", "marker_length"},
    {"tag_size", "marker_length"},
    {"dictionary", "marker_dictionary"},
    {"K", "camera_matrix"},
    {"intrinsics", "camera_matrix"},
    {"D", "distortion_coefficients"},
    {"dist_coeffs", "distortion_coefficients"},
    {"width", "image_width"},
    {"height", "image_height"},
}};

/// The key that was meant by one that is not known.
std::string KeyMeantBy(const std::string& key) {
  for (const auto& [other, meant] : kOtherNames)
    if (key == other) return meant;
  return NearestName(key, kKnownKeys);
}

/// Refuses texts whose nesting would exhaust the parser's stack.
void CheckText(std::string_view text, const std::string& name) {
  if (text.size() > kMaxText)
    throw DataError(say::recording::CameraTooLong(name, text.size(), kMaxText));
  const std::string_view first = text.substr(0, 2);
  if (first == "\xFF\xFE" || first == "\xFE\xFF" ||
      (first.size() == 2 && (first[0] == '\0') != (first[1] == '\0')))
    throw DataError(say::recording::ListUtf16(name));
  if (text.find('\0') != std::string_view::npos)
    throw DataError(say::recording::CameraZeroBytes(name));
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
      throw DataError(say::recording::CameraNesting(name, kMaxNesting));
  }
}

/// The text as plain YAML: OpenCV's header `%YAML:1.0` is not a YAML directive.
std::string WithoutHeader(std::string_view text) {
  if (constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF"; text.starts_with(kByteOrderMark))
    text.remove_prefix(kByteOrderMark.size());
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
    if (const std::size_t begin = text.find_first_not_of(" \t\r\n");
        begin != std::string_view::npos && text[begin] == '<')
      throw DataError(say::recording::CameraXml(name_));
    try {
      root_ = YAML::Load(WithoutHeader(text));
    } catch (const YAML::Exception& error) {
      throw DataError(say::recording::CameraNotYaml(name_, FirstLine(error.what())));
    }
    if (!root_.IsMap()) throw DataError(say::recording::CameraNoKeys(name_));
  }

  /// @throws DataError for a file of another program, an unknown key, or a key that occurs twice,
  /// because its two values may differ.
  void CheckNames() const {
    for (const auto& [key, program] : kForeignKeys)
      if (has(key)) throw DataError(say::recording::CameraForeign(name_, program, key));
    std::set<std::string> read;
    for (const auto& entry : root_) {
      const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : std::string();
      if (!read.insert(key).second)
        throw DataError(say::recording::KeyTwice(name_, key.substr(0, 60)));
      const auto is_key = [&](const char* known) { return key == known; };
      if (std::ranges::any_of(kKnownKeys, is_key) || std::ranges::any_of(kOfCalibrators, is_key))
        continue;
      throw DataError(say::recording::UnknownKey(name_, key.substr(0, 60), KeyMeantBy(key)));
    }
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
      throw DataError(say::recording::WholeNumber(Where(key), value));
    }
    return static_cast<int>(value);
  }

  [[nodiscard]] std::string Text(const char* key) const {
    const YAML::Node node = Required(key);
    if (!node.IsScalar()) throw DataError(say::recording::NotText(Where(key)));
    return node.Scalar();
  }

  /// A list of texts, or a single one.
  [[nodiscard]] std::vector<std::string> Texts(const char* key) const {
    const YAML::Node node = Required(key);
    if (node.IsScalar()) return {node.Scalar()};
    std::vector<std::string> texts;
    for (const YAML::Node& element : node) {
      if (!node.IsSequence() || !element.IsScalar())
        throw DataError(say::recording::NotText(Where(key)));
      texts.push_back(element.Scalar());
    }
    return texts;
  }

  /// 0 or 1, or as YAML has it, true or false.
  [[nodiscard]] bool Flag(const char* key) const {
    const std::string text = Text(key);
    if (text == "true" || text == "True") return true;
    if (text == "false" || text == "False") return false;
    const int value = Integer(key);
    if (value != 0 && value != 1) throw DataError(say::recording::ZeroOrOne(Where(key), value));
    return value == 1;
  }

  /// The elements of a matrix, row by row: an !!opencv-matrix, or a plain list.
  [[nodiscard]] std::vector<double> Matrix(const char* key) const {
    const YAML::Node node = Required(key);
    const YAML::Node data = node.IsMap() ? node["data"] : node;
    if (!data.IsDefined() || !data.IsSequence() || data.size() > 64)
      throw DataError(say::recording::NotMatrix(Where(key)));
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
      throw DataError(say::recording::OtherKeys(
          Where(key), std::vector<std::string>(names.begin(), names.end())));
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
    if (!has(key)) throw DataError(say::recording::KeyMissing(Where(key)));
    return root_[key];
  }

  [[nodiscard]] double Number(const YAML::Node& node, const char* key) const {
    const std::string text = node.IsScalar() ? node.Scalar() : std::string();
    const char* begin = text.data() + (text.starts_with('+') ? 1 : 0);
    const char* end = text.data() + text.size();
    double value = 0;
    const auto [stop, error] = std::from_chars(begin, end, value);
    if (begin == end || stop != end || error != std::errc() || !std::isfinite(value)) {
      throw DataError(text.empty()
                          ? say::recording::NotNumbers(Where(key))
                          : say::recording::OtherThanNumbers(Where(key), text.substr(0, 60)));
    }
    return value;
  }

  std::string name_;
  YAML::Node root_;  // Only read: operator[] of a const node adds nothing.
};

void ReadCameraMatrix(const Keys& keys, const char* key, Intrinsics& intrinsics) {
  const std::vector<double> k = keys.Matrix(key);
  if (k.size() != 9) throw DataError(say::recording::Matrix3x3(keys.Where(key), k.size()));
  if (!(k[0] > 0 && k[4] > 0)) {
    throw DataError(say::recording::FocalLengths(keys.Where(key), k[0], k[4]));
  }
  if (k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1) {
    throw DataError(
        say::recording::CameraMatrix(keys.Where(key), fmt::format("{}", fmt::join(k, " "))));
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
    throw DataError(say::recording::OtherImageSize(keys.Where(key), k[0], k[4], k[2], k[5],
                                                   intrinsics.width, intrinsics.height));
  }
}

/// The lens by its coefficients: 4 (an equidistant lens, or the plain model without k3), 5, 8 or
/// more, of which those behind the eighth must be 0.
void ReadDistortion(const Keys& keys, const char* key, bool is_equidistant,
                    Intrinsics& intrinsics) {
  constexpr std::size_t kRational = 8;
  std::vector<double> d = keys.Matrix(key);
  const auto is_zero = [](double value) { return value == 0; };
  const bool is_read =
      d.size() == 4 || d.size() == 5 ||
      (d.size() >= 5 && std::all_of(d.begin() + 5, d.end(), is_zero)) ||
      (d.size() >= kRational && std::all_of(d.begin() + kRational, d.end(), is_zero));
  if (!is_read || (is_equidistant && d.size() != 4))
    throw DataError(is_equidistant ? say::recording::LensEquidistant(keys.Where(key), d.size())
                                   : say::recording::LensElements(keys.Where(key), d.size()));
  for (const double value : d) {
    if (std::abs(value) > kMaxDistortion)
      throw DataError(say::recording::LensImplausible(keys.Where(key), value));
  }
  if (is_equidistant) {
    const auto lens = RationalOfEquidistant({d[0], d[1], d[2], d[3]}, intrinsics);
    if (!lens) throw DataError(say::recording::LensTooWide(keys.Where(key)));
    intrinsics.distortion = *lens;
  } else {
    d.resize(kRational);
    (void)SetLensCoefficients(d, intrinsics);
  }
  // A lens model must be one-to-one over the whole image, or pixels cannot be converted to rays.
  for (const double x : {0.0, 0.25, 0.75, 1.0}) {
    for (const double y : {0.0, 0.25, 0.75, 1.0}) {
      const Eigen::Vector2d pixel(x * (intrinsics.width - 1), y * (intrinsics.height - 1));
      const Eigen::Vector2d ray = Undistort(intrinsics, pixel);
      const double error_px = (Project(intrinsics, ray.homogeneous()) - pixel).norm();
      if (!(error_px < 0.5)) {
        throw DataError(say::recording::LensNotInvertible(keys.Where(key), pixel.x(), pixel.y()));
      }
    }
  }
}

// Whether the lens is equidistant. By the model that the coefficients belong to, as ROS names it,
// or by OpenCV's calibration program; a wide lens of another model read as OpenCV's plain one gives
// rays that are off by degrees.
bool IsEquidistant(const Keys& keys) {
  if (constexpr const char* kKey = "fisheye_model"; keys.has(kKey) && keys.Flag(kKey)) return true;
  constexpr const char* kKey = "distortion_model";
  if (!keys.has(kKey)) return false;
  const std::vector<std::string> equidistant = {"equidistant", "fisheye", "kannala_brandt"};
  const std::vector<std::string> plain = {"plumb_bob", "radtan", "brown_conrady"};
  const std::vector<std::string> none = {"none", "pinhole"};
  const std::string model = keys.Text(kKey);
  const auto is_in = [&](const auto& names) {
    return std::ranges::find(names, model) != names.end();
  };
  if (is_in(equidistant)) return true;
  if (model == "rational_polynomial") return false;
  if (!is_in(plain) && !is_in(none)) {
    std::vector<std::string> known = plain;
    known.insert(known.end(), none.begin(), none.end());
    known.push_back("rational_polynomial");
    known.push_back("equidistant");
    throw DataError(say::recording::LensModel(keys.Where(kKey), model.substr(0, 60), known));
  }
  constexpr const char* kLens = "distortion_coefficients";
  if (!keys.has(kLens)) return false;
  const std::vector<double> d = keys.Matrix(kLens);
  const std::size_t most = is_in(none) ? 0 : 5;
  if (d.size() > most && std::any_of(d.begin() + static_cast<std::ptrdiff_t>(most), d.end(),
                                     [](double value) { return value != 0; }))
    throw DataError(say::recording::LensContradicts(keys.Where(kKey), model, most, kLens));
  return false;
}

void CheckSize(const Keys& keys, const Intrinsics& intrinsics, const Message& what) {
  if (intrinsics.width >= 1 && intrinsics.height >= 1 && intrinsics.width <= kMaxImageSide &&
      intrinsics.height <= kMaxImageSide)
    return;
  throw DataError(say::recording::CameraImageSize(keys.name(), what, intrinsics.width,
                                                  intrinsics.height, kMaxImageSide));
}

Pose ReadRigid(const Keys& keys, const char* key) {
  const std::vector<double> m = keys.Matrix(key);
  if (m.size() != 16) throw DataError(say::recording::Matrix4x4(keys.Where(key), m.size()));
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
    throw DataError(say::recording::NotRigid(keys.Where(key), kMaxBaseline_m));
  }
  Pose T = Pose::Identity();
  T.linear() = rotation;
  T.translation() = translation_m;
  return Orthonormalised(T);
}

/// The model of `distortion_coefficients` is not that of the depth camera's.
void CheckDepthLens(const Keys& keys, bool color_is_equidistant) {
  constexpr const char* kKey = "depth_distortion_coefficients";
  if (!color_is_equidistant || !keys.has(kKey)) return;
  const std::vector<double> d = keys.Matrix(kKey);
  if (d.size() == 4 && std::ranges::any_of(d, [](double value) { return value != 0; }))
    throw DataError(say::recording::LensOfDepth(keys.Where(kKey)));
}

void ReadDepthCamera(const Keys& keys, bool color_is_equidistant, CameraFile& camera) {
  std::vector<std::string> stated;
  for (const char* key : kDepthCameraKeys)
    if (keys.has(key)) stated.emplace_back(key);
  if (!keys.has("depth_registered")) {
    if (!stated.empty())
      throw DataError(say::recording::RegisteredMissing(keys.name(), std::move(stated)));
    return;
  }
  if (keys.Flag("depth_registered")) {
    if (!stated.empty())
      camera.warnings.push_back(say::recording::DepthCameraUnused(keys.name(), std::move(stated)));
    return;
  }
  CheckDepthLens(keys, color_is_equidistant);
  if (!keys.has("depth_camera_matrix") || !keys.has("depth_distortion_coefficients") ||
      !keys.has("T_color_depth")) {
    camera.warnings.push_back(say::recording::DepthCameraUnknown(keys.name()));
    camera.depth_camera_unknown = true;
    return;
  }
  DepthCamera depth;
  depth.intrinsics.width =
      keys.has("depth_image_width") ? keys.Integer("depth_image_width") : camera.color.width;
  depth.intrinsics.height =
      keys.has("depth_image_height") ? keys.Integer("depth_image_height") : camera.color.height;
  CheckSize(keys, depth.intrinsics, say::recording::Depth());
  ReadCameraMatrix(keys, "depth_camera_matrix", depth.intrinsics);
  ReadDistortion(keys, "depth_distortion_coefficients", false, depth.intrinsics);
  depth.T_color_depth = ReadRigid(keys, "T_color_depth");
  camera.depth_camera = depth;
}

/// What an earlier reader had assumed, by the keys that hold it.
void ReadAssumed(const Keys& keys, CameraFile& camera) {
  constexpr const char* kKey = "assumed";
  if (!keys.has(kKey)) return;
  const std::array<std::pair<const char*, bool*>, 3> known = {
      {{kAssumedCamera, &camera.color_assumed},
       {kAssumedDepthUnit, &camera.depth_unit_assumed},
       {kAssumedDepthCamera, &camera.depth_camera_estimated}}};
  const std::vector<std::string> names = keys.Texts(kKey);
  for (const std::string& name : names) {
    const auto found =
        std::ranges::find_if(known, [&](const auto& one) { return name == one.first; });
    if (found == known.end())
      throw DataError(
          say::recording::Assumed(keys.Where(kKey), name.substr(0, 60),
                                  {kAssumedCamera, kAssumedDepthUnit, kAssumedDepthCamera}));
    *found->second = true;
  }
  if (!names.empty()) camera.warnings.push_back(say::recording::StillAssumed(keys.name(), names));
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
  if (const std::optional<Message> fault = FaultOf(noise)) {
    throw DataError(say::recording::Noise(keys.Where(kKey), *fault));
  }
  camera.depth_noise = noise;
}

void ReadDepthSensor(const Keys& keys, CameraFile& camera) {
  if (constexpr const char* kKey = "depth_sensor"; keys.has(kKey)) {
    const std::string name = keys.Text(kKey);
    camera.depth_sensor = Named<DepthSensor>(name);
    if (!camera.depth_sensor)
      throw DataError(say::recording::DepthSensor(
          keys.Where(kKey), name.substr(0, 60),
          {kNamesOf<DepthSensor>.begin(), kNamesOf<DepthSensor>.end()}));
  }
  if (constexpr const char* kKey = "depth_range"; keys.has(kKey)) {
    const std::vector<double> range = keys.Matrix(kKey);
    // Nearer than 1 cm or farther than 100 m no depth camera measures; units are metres.
    if (range.size() != 2 || !(range[0] >= 0.01 && range[0] < range[1] && range[1] <= 100))
      throw DataError(
          say::recording::DepthRange(keys.Where(kKey), fmt::format("{}", fmt::join(range, " "))));
    camera.usable_depth = UsableDepth{.nearest_m = range[0], .farthest_m = range[1]};
  }
  ReadDepthNoise(keys, camera);
}

void ReadMarkers(const Keys& keys, CameraFile& camera) {
  if (keys.has("marker_dictionary")) {
    const std::string name = keys.Text("marker_dictionary");
    const std::optional<MarkerDictionary> dictionary = MarkerDictionary::Find(name);
    if (!dictionary) {
      throw DataError(say::recording::Dictionary(
          keys.Where("marker_dictionary"), name.substr(0, 60), MarkerDictionary::KnownNames()));
    }
    camera.room_markers.dictionary = dictionary->name();
  }
  if (keys.has("marker_length")) {
    camera.room_markers.length_m = keys.Number("marker_length");
    if (!(*camera.room_markers.length_m > 0 &&
          *camera.room_markers.length_m < kMaxMarkerLength_m)) {
      throw DataError(say::recording::MarkerLength(
          keys.Where("marker_length"), *camera.room_markers.length_m, kMaxMarkerLength_m));
    }
  }
  if (keys.has("reference_marker")) {
    camera.room_markers.reference = keys.Integer("reference_marker");
    if (*camera.room_markers.reference < 0 || *camera.room_markers.reference > kMaxMarkerId) {
      throw DataError(say::recording::MarkerId(keys.Where("reference_marker"),
                                               *camera.room_markers.reference, kMaxMarkerId));
    }
  }
}

}  // namespace

CameraFile ParseCameraFile(std::string_view text, const std::string& name) try {
  const Keys keys(text, name);
  keys.CheckNames();
  const bool is_equidistant = IsEquidistant(keys);
  CameraFile camera;
  camera.color.width = keys.Integer("image_width");
  camera.color.height = keys.Integer("image_height");
  CheckSize(keys, camera.color, say::recording::Colour());
  ReadCameraMatrix(keys, "camera_matrix", camera.color);
  if (keys.has("distortion_coefficients") || is_equidistant) {
    ReadDistortion(keys, "distortion_coefficients", is_equidistant, camera.color);
  } else {
    camera.warnings.push_back(say::recording::NoDistortion(name));
  }
  if (keys.has("depth_scale")) {
    const double scale = keys.Number("depth_scale");
    if (!(scale >= kMinDepthScale && scale <= kMaxDepthScale)) {
      throw DataError(say::recording::DepthScale(keys.Where("depth_scale"), scale, kMinDepthScale,
                                                 kMaxDepthScale));
    }
    camera.depth_scale = scale;
  }
  ReadDepthCamera(keys, is_equidistant, camera);
  ReadAssumed(keys, camera);
  ReadDepthSensor(keys, camera);
  ReadMarkers(keys, camera);
  return camera;
} catch (const YAML::Exception& error) {
  throw DataError(say::recording::CameraUnreadable(name, std::string(error.what()).substr(0, 200)));
}

void TakeOver(const CameraFile& camera, StreamInfo& info) {
  info.intrinsics = camera.color;
  info.intrinsics_assumed = info.intrinsics_assumed || camera.color_assumed;
  info.depth_unit_assumed = info.depth_unit_assumed || camera.depth_unit_assumed;
  info.depth_camera_estimated = info.depth_camera_estimated || camera.depth_camera_estimated;
  if (camera.depth_sensor) {
    info.depth_sensor = *camera.depth_sensor;
    info.depth_noise = ClassOf(info.depth_sensor).noise;
    info.usable_depth = ClassOf(info.depth_sensor).range;
  }
  if (camera.depth_noise) info.depth_noise = *camera.depth_noise;
  if (camera.usable_depth) info.usable_depth = *camera.usable_depth;
  info.room_markers = camera.room_markers.Or(info.room_markers);
  info.warnings.insert(info.warnings.end(), camera.warnings.begin(), camera.warnings.end());
}

}  // namespace plumb
