#include "daemon/files/scene_json.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/parse_number.hpp"
#include "algo/types/marker_dictionary.hpp"
#include "drivers/files/image_file.hpp"

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kSceneFormat = 1;
constexpr int kMaxMarkerId = 65535;
constexpr double kMaxCoordinate_m = 1e4;
constexpr double kMaxCount = 1e9;
constexpr std::size_t kMaxMarkers = 4096;
constexpr double kMinStep_m = 1e-5;
constexpr double kMaxStep_m = 1.0;

/// One value of the document with its path, for messages.
class SceneValue {
 public:
  SceneValue(const Json& json, std::string where) : json_(json), where_(std::move(where)) {}

  [[nodiscard]] bool has(const char* key) const { return json_.is_object() && json_.contains(key); }
  [[nodiscard]] bool is_null() const { return json_.is_null(); }
  [[nodiscard]] const Json& json() const { return json_; }

  [[nodiscard]] SceneValue operator[](const char* key) const {
    if (!json_.is_object()) Fail("is not an object");
    if (!json_.contains(key))
      throw DataError(fmt::format("{}.{} is missing; make the scene again", where_, key));
    return {json_[key], fmt::format("{}.{}", where_, key)};
  }

  [[nodiscard]] SceneValue At(std::size_t index) const {
    return {json_[index], fmt::format("{}[{}]", where_, index)};
  }

  [[nodiscard]] std::string Text() const {
    if (!json_.is_string()) Fail("is not text");
    return json_.get<std::string>();
  }

  [[nodiscard]] double Number(double min, double max) const {
    if (!json_.is_number()) Fail("is not a number");
    const double value = json_.get<double>();
    if (!(value >= min && value <= max))
      Fail(fmt::format("is {}, expected {} to {}", value, min, max));
    return value;
  }

  [[nodiscard]] std::int64_t Integer(double min, double max) const {
    if (!json_.is_number_integer()) Fail("is not a whole number");
    return static_cast<std::int64_t>(Number(min, max));
  }

  void RequireArray(std::size_t size) const {
    if (!json_.is_array() || json_.size() != size) Fail(fmt::format("is not a list of {}", size));
  }

  /// Calls `visit(key, value)` for each entry of an object.
  template <typename Visit>
  void ForEach(const Visit& visit) const {
    if (!json_.is_object()) Fail("is not an object");
    for (const auto& [key, value] : json_.items())
      visit(key, SceneValue(value, fmt::format("{}.{}", where_, key.substr(0, 40))));
  }

  [[noreturn]] void Fail(const std::string& what) const {
    throw DataError(fmt::format("{} {}; make the scene again", where_, what));
  }

 private:
  const Json& json_;
  std::string where_;
};

Json MapJson(const std::map<std::string, double>& values) {
  Json json = Json::object();
  for (const auto& [key, value] : values) json[key] = value;
  return json;
}

/// A marker id that is the key of an object.
int MarkerId(const std::string& key, const SceneValue& value) {
  const std::optional<int> id = ParseNumber<int>(key);
  if (!id || *id < 0 || *id > kMaxMarkerId)
    value.Fail(fmt::format("is not a marker id from 0 to {}", kMaxMarkerId));
  return *id;
}

void ReadMarkers(const SceneValue& root, Scene& scene) {
  root["markers"].ForEach([&](const std::string& key, const SceneValue& corners) {
    SceneMarker& marker = scene.markers[MarkerId(key, corners)];
    if (scene.markers.size() > kMaxMarkers)
      corners.Fail(fmt::format("is one of more than {} markers", kMaxMarkers));
    corners.RequireArray(4);
    for (std::size_t k = 0; k < 4; ++k) {
      const SceneValue corner = corners.At(k);
      corner.RequireArray(3);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        marker.corners[k][static_cast<Eigen::Index>(axis)] =
            corner.At(axis).Number(-kMaxCoordinate_m, kMaxCoordinate_m);
      }
    }
  });
  const auto find = [&](const std::string& key, const SceneValue& value) -> SceneMarker& {
    const auto marker = scene.markers.find(MarkerId(key, value));
    if (marker == scene.markers.end()) value.Fail("belongs to no marker of the scene");
    return marker->second;
  };
  if (root.has("marker_views")) {
    root["marker_views"].ForEach([&](const std::string& key, const SceneValue& views) {
      find(key, views).num_views = static_cast<int>(views.Integer(0, kMaxCount));
    });
  }
  if (root.has("marker_sigma_m")) {
    root["marker_sigma_m"].ForEach([&](const std::string& key, const SceneValue& sigma) {
      find(key, sigma).sigma_m = sigma.Number(0, 1e3);
    });
  }
}

/// Keys that Plumb writes but other programs may leave out.
void ReadMarkerKind(const SceneValue& root, Scene& scene) {
  if (root.has("marker_dictionary")) {
    const SceneValue value = root["marker_dictionary"];
    const std::string name = value.Text();
    if (!name.empty() && !MarkerDictionary::Find(name))
      value.Fail(fmt::format("is \"{}\", which is not a known dictionary", name.substr(0, 60)));
    scene.marker_dictionary = name;
  }
  if (root.has("marker_length_m")) scene.marker_length_m = root["marker_length_m"].Number(0, 10);
  if (root.has("reference_marker") && !root["reference_marker"].is_null()) {
    scene.reference_marker = static_cast<int>(root["reference_marker"].Integer(0, kMaxMarkerId));
  }
}

std::optional<GridShape> ReadGrid(const SceneValue& heightmap) {
  if (heightmap.is_null()) return std::nullopt;
  GridShape grid;
  grid.x_min = heightmap["x_min"].Number(-kMaxCoordinate_m, kMaxCoordinate_m);
  grid.y_min = heightmap["y_min"].Number(-kMaxCoordinate_m, kMaxCoordinate_m);
  grid.step = heightmap["step"].Number(kMinStep_m, kMaxStep_m);
  grid.width = static_cast<int>(heightmap["width"].Integer(1, kMaxGridSide));
  grid.height = static_cast<int>(heightmap["height"].Integer(1, kMaxGridSide));
  return grid;
}

Json ParseText(std::string_view text, const std::string& name) {
  try {
    return ParseBoundedJson<Json>(text);
  } catch (const DataError& error) {
    throw DataError(fmt::format("{}: {}; make the scene again", name,
                                std::string_view(error.what()).substr(0, 200)));
  }
}

}  // namespace

std::string SceneJson(const Scene& scene) {
  Json json;
  json["format"] = kSceneFormat;
  json["preset"] = Name(scene.preset);
  json["frame"] = Name(scene.frame);
  json["marker_dictionary"] = scene.marker_dictionary;
  json["marker_length_m"] = scene.marker_length_m;
  json["reference_marker"] = scene.reference_marker ? Json(*scene.reference_marker) : Json(nullptr);
  json["markers"] = Json::object();
  json["marker_views"] = Json::object();
  json["marker_sigma_m"] = Json::object();
  for (const auto& [id, marker] : scene.markers) {
    const std::string key = std::to_string(id);
    Json corners = Json::array();
    for (const Eigen::Vector3d& corner : marker.corners)
      corners.push_back({corner.x(), corner.y(), corner.z()});
    json["markers"][key] = corners;
    json["marker_views"][key] = marker.num_views;
    json["marker_sigma_m"][key] = marker.sigma_m;
  }
  json["heightmap"] = nullptr;
  if (scene.height_map) {
    const GridShape& grid = scene.height_map->grid;
    json["heightmap"] = {{"x_min", grid.x_min},
                         {"y_min", grid.y_min},
                         {"step", grid.step},
                         {"width", grid.width},
                         {"height", grid.height}};
  }
  json["keyframes"] = scene.keyframes.size();
  json["frames"] = {{"total", scene.frames_total},
                    {"tracked", scene.frames_tracked},
                    {"dropped", scene.frames_dropped},
                    {"fewer_keypoints", scene.frames_fewer_keypoints}};
  json["longest_lost_s"] = scene.longest_lost_s;
  json["breathing"] = nullptr;
  if (scene.breathing) {
    json["breathing"] = {{"amplitude_m", scene.breathing->amplitude_m},
                         {"sigma_m", scene.breathing->sigma_m},
                         {"period_s", scene.breathing->period_s},
                         {"limit_m", scene.breathing->limit_m}};
  }
  json["sensor_profile"] = scene.sensor_profile ? Json(*scene.sensor_profile) : Json();
  json["calibration"] = MapJson(scene.calibration);
  json["calibration_sigma"] = MapJson(scene.calibration_sigma);
  json["calibration_prior_sigma"] = MapJson(scene.calibration_prior_sigma);
  json["timings_s"] = MapJson(scene.timings_s);
  json["warnings"] = scene.warnings;
  // Warnings can quote file names in any encoding; invalid UTF-8 is replaced.
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

SceneHeader ParseSceneJson(std::string_view text, const std::string& name) {
  const Json json = ParseText(text, name);
  const SceneValue root(json, name);
  const SceneValue format_value = root["format"];
  const std::int64_t format = format_value.Integer(-kMaxCount, kMaxCount);
  if (format > kSceneFormat) {
    throw DataError(
        fmt::format("{} has format {}, this version reads format {}; update Plumb or make the "
                    "scene again with this version",
                    name, format, kSceneFormat));
  }
  if (format < kSceneFormat)
    format_value.Fail(fmt::format("is {}, expected {}", format, kSceneFormat));

  SceneHeader header;
  Scene& scene = header.scene;
  const std::optional<Preset> preset = Named<Preset>(root["preset"].Text());
  if (!preset) root["preset"].Fail("is neither best nor paper");
  scene.preset = *preset;
  const std::optional<SceneFrame> frame = Named<SceneFrame>(root["frame"].Text());
  if (!frame) root["frame"].Fail("is neither reference_marker nor first_keyframe");
  scene.frame = *frame;
  ReadMarkerKind(root, scene);
  ReadMarkers(root, scene);
  header.grid = ReadGrid(root["heightmap"]);
  header.num_keyframes = static_cast<std::size_t>(root["keyframes"].Integer(0, kMaxCount));
  const SceneValue frames = root["frames"];
  scene.frames_total = frames["total"].Integer(0, kMaxCount);
  scene.frames_tracked = frames["tracked"].Integer(0, kMaxCount);
  scene.frames_dropped = frames["dropped"].Integer(0, kMaxCount);
  if (frames.has("fewer_keypoints"))
    scene.frames_fewer_keypoints = frames["fewer_keypoints"].Integer(0, kMaxCount);
  if (root.has("longest_lost_s")) scene.longest_lost_s = root["longest_lost_s"].Number(0, 1e9);
  if (root.has("breathing") && !root["breathing"].is_null()) {
    const SceneValue breathing = root["breathing"];
    scene.breathing = Breathing{.amplitude_m = breathing["amplitude_m"].Number(0, 1),
                                .sigma_m = breathing["sigma_m"].Number(0, 1),
                                .period_s = breathing["period_s"].Number(0, 1e3),
                                .limit_m = breathing["limit_m"].Number(0, 1)};
  }
  if (root.has("sensor_profile") && !root["sensor_profile"].is_null())
    scene.sensor_profile = root["sensor_profile"].Text();
  const auto read = [&](const char* map_name, double least, double most,
                        std::map<std::string, double>& values) {
    if (!root.has(map_name)) return;
    root[map_name].ForEach([&](const std::string& key, const SceneValue& value) {
      values[key] = value.Number(least, most);
    });
  };
  read("calibration", -1e12, 1e12, scene.calibration);
  read("calibration_sigma", 0, 1e12, scene.calibration_sigma);
  read("calibration_prior_sigma", 0, 1e12, scene.calibration_prior_sigma);
  read("timings_s", 0, 1e9, scene.timings_s);
  if (root.has("warnings")) {
    const SceneValue warnings = root["warnings"];
    if (!warnings.json().is_array()) warnings.Fail("is not a list");
    for (std::size_t i = 0; i < warnings.json().size(); ++i)
      scene.warnings.push_back(warnings.At(i).Text());
  }
  return header;
}

}  // namespace plumb
