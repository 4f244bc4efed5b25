#include "daemon/evaluation/truth.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::size_t kMaxFileBytes = std::size_t{512} << 20;
constexpr std::size_t kMaxElements = 20'000'000;

[[noreturn]] void Fail(const fs::path& file, std::string_view what) {
  throw DataError(fmt::format("cannot read the truth file '{}': {}", file.string(), what));
}

std::string ReadWhole(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in)
    Fail(file,
         "it does not exist or is not readable; a suite needs groundtruth.txt, markers.json, "
         "motion.json, body.ply per scene");
  std::error_code error;
  const std::uintmax_t size = fs::file_size(file, error);
  if (error || size > kMaxFileBytes)
    Fail(file, fmt::format("expected at most {} MiB", kMaxFileBytes >> 20));
  std::string text(static_cast<std::size_t>(size), '\0');
  in.read(text.data(), static_cast<std::streamsize>(size));
  if (in.gcount() != static_cast<std::streamsize>(size)) Fail(file, "the file ends early");
  return text;
}

json ReadJson(const fs::path& file) {
  try {
    return ParseBoundedJson(ReadWhole(file));
  } catch (const DataError& error) {
    Fail(file, error.what());
  }
}

Pose ToPose(const json& rows) {
  Eigen::Matrix4d m;
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c)
      m(r, c) = rows.at(static_cast<std::size_t>(r)).at(static_cast<std::size_t>(c)).get<double>();
  }
  Pose T;
  T.matrix() = m;
  return Orthonormalised(T);
}

std::vector<StampedPose> ReadTrajectory(const fs::path& file) {
  std::istringstream in(ReadWhole(file));
  std::vector<StampedPose> trajectory;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    double t = 0, x = 0, y = 0, z = 0, qx = 0, qy = 0, qz = 0, qw = 0;
    if (!(fields >> t >> x >> y >> z >> qx >> qy >> qz >> qw)) {
      Fail(file, fmt::format("line {}: expected 'time tx ty tz qx qy qz qw'", number));
    }
    const Eigen::Quaterniond q(qw, qx, qy, qz);
    if (!(q.norm() > 0.5)) Fail(file, fmt::format("line {}: the quaternion has no length", number));
    if (!trajectory.empty() && !(t > trajectory.back().time_s))
      Fail(file, fmt::format("line {}: expected rising times", number));
    StampedPose pose{.time_s = t};
    pose.T_world_camera.linear() = q.normalized().toRotationMatrix();
    pose.T_world_camera.translation() = Eigen::Vector3d(x, y, z);
    trajectory.push_back(pose);
  }
  if (trajectory.size() < 2) Fail(file, "expected at least two poses");
  return trajectory;
}

struct PlyProperty {
  std::string name;
  char kind = 'f';  // f: floating point, i: signed, u: unsigned
  std::size_t bytes = 4;
};

PlyProperty ParseProperty(const fs::path& file, const std::string& type, const std::string& name) {
  static const std::map<std::string, std::pair<char, std::size_t>> kTypes = {
      {"char", {'i', 1}},  {"int8", {'i', 1}},    {"uchar", {'u', 1}},  {"uint8", {'u', 1}},
      {"short", {'i', 2}}, {"int16", {'i', 2}},   {"ushort", {'u', 2}}, {"uint16", {'u', 2}},
      {"int", {'i', 4}},   {"int32", {'i', 4}},   {"uint", {'u', 4}},   {"uint32", {'u', 4}},
      {"float", {'f', 4}}, {"float32", {'f', 4}}, {"double", {'f', 8}}, {"float64", {'f', 8}}};
  const auto found = kTypes.find(type);
  if (found == kTypes.end()) Fail(file, fmt::format("unknown property type '{}'", type));
  return {name, found->second.first, found->second.second};
}

double Value(const PlyProperty& property, const char* at) {
  const auto load = [&](auto value) {
    std::memcpy(&value, at, sizeof(value));
    return static_cast<double>(value);
  };
  if (property.kind == 'f') return property.bytes == 4 ? load(float{}) : load(double{});
  if (property.kind == 'i')
    return property.bytes == 1   ? load(std::int8_t{})
           : property.bytes == 2 ? load(std::int16_t{})
                                 : load(std::int32_t{});
  return property.bytes == 1   ? load(std::uint8_t{})
         : property.bytes == 2 ? load(std::uint16_t{})
                               : load(std::uint32_t{});
}

struct PlyHeader {
  std::size_t num_vertices = 0, num_faces = 0, data_offset = 0;
  std::vector<PlyProperty> vertex;
  PlyProperty face_count, face_index;  // of the one list property of faces
};

PlyHeader ParseHeader(const fs::path& file, const std::string& data) {
  static constexpr std::string_view kEnd = "end_header\n";
  const std::size_t end = data.substr(0, 65536).find(kEnd);
  if (data.rfind("ply", 0) != 0 || end == std::string::npos) Fail(file, "not a PLY file");
  PlyHeader header;
  header.data_offset = end + kEnd.size();
  std::istringstream lines(data.substr(0, end));
  std::string line, element;
  while (std::getline(lines, line)) {
    std::istringstream fields(line);
    std::string word, a, b, c, d;
    fields >> word >> a >> b >> c >> d;
    if (word == "format" && a != "binary_little_endian")
      Fail(file, fmt::format("expected format binary_little_endian, found '{}'", a));
    if (word == "element") {
      element = a;
      const std::size_t count = std::strtoull(b.c_str(), nullptr, 10);
      if (count > kMaxElements)
        Fail(file, fmt::format("expected at most {} elements, found {}", kMaxElements, count));
      if (a == "vertex") header.num_vertices = count;
      if (a == "face") header.num_faces = count;
    } else if (word == "property" && element == "vertex") {
      header.vertex.push_back(ParseProperty(file, a, b));
    } else if (word == "property" && element == "face") {
      if (a != "list") Fail(file, "expected faces with one list of vertex indices");
      header.face_count = ParseProperty(file, b, d);
      header.face_index = ParseProperty(file, c, d);
    }
  }
  return header;
}

TrueSurface ReadSurface(const fs::path& file) {
  const std::string data = ReadWhole(file);
  const PlyHeader header = ParseHeader(file, data);
  std::size_t stride = 0;
  std::map<std::string, std::pair<std::size_t, PlyProperty>> columns;
  for (const PlyProperty& property : header.vertex) {
    columns[property.name] = {stride, property};
    stride += property.bytes;
  }
  for (const char* name : {"x", "y", "z"}) {
    if (!columns.contains(name)) Fail(file, fmt::format("vertices have no property '{}'", name));
  }
  if (header.data_offset + stride * header.num_vertices > data.size())
    Fail(file, "the file ends within the vertices");

  TrueSurface surface;
  const char* at = data.data() + header.data_offset;
  const auto column = [&](const char* name) {
    return Value(columns.at(name).second, at + columns.at(name).first);
  };
  for (std::size_t i = 0; i < header.num_vertices; ++i, at += stride) {
    surface.vertices_world.emplace_back(column("x"), column("y"), column("z"));
    surface.frames_seen.push_back(columns.contains("seen") ? static_cast<float>(column("seen"))
                                                           : 1e9F);
  }
  const char* const last = data.data() + data.size();
  for (std::size_t i = 0; i < header.num_faces; ++i) {
    if (at + header.face_count.bytes > last) Fail(file, "the file ends within the faces");
    const auto count = static_cast<std::size_t>(Value(header.face_count, at));
    at += header.face_count.bytes;
    if (count != 3 || at + 3 * header.face_index.bytes > last)
      Fail(file, fmt::format("face {}: expected a whole triangle", i));
    std::array<std::uint32_t, 3> triangle{};
    for (std::uint32_t& index : triangle) {
      const double value = Value(header.face_index, at);
      if (!(value >= 0 && value < static_cast<double>(header.num_vertices)))
        Fail(file, fmt::format("face {}: vertex {} does not exist", i, value));
      index = static_cast<std::uint32_t>(value);
      at += header.face_index.bytes;
    }
    surface.triangles.push_back(triangle);
  }
  return surface;
}

}  // namespace

SceneTruth ReadSceneTruth(const fs::path& folder) {
  SceneTruth truth;
  truth.trajectory = ReadTrajectory(folder / "groundtruth.txt");
  const json markers = ReadJson(folder / "markers.json");
  const json motion = ReadJson(folder / "motion.json");
  try {
    const MarkerCorners corners = CornersInMarkerFrame(markers.at("length").get<double>());
    for (const auto& [id, marker] : markers.at("markers").items()) {
      const Pose T_world_marker = ToPose(marker.at("T_world_marker"));
      MarkerCorners& in_world = truth.markers[std::stoi(id)];
      for (std::size_t k = 0; k < 4; ++k) in_world[k] = T_world_marker * corners[k];
    }
  } catch (const std::exception& error) {
    Fail(folder / "markers.json", error.what());
  }
  try {
    truth.T_world_body = ToPose(motion.at("T_world_body"));
    truth.T_world_reference_marker = ToPose(motion.at("T_world_reference_marker"));
    for (int i = 0; i < 3; ++i)
      truth.centroid_body[i] =
          motion.at("centroid_body").at(static_cast<std::size_t>(i)).get<double>();
  } catch (const std::exception& error) {
    Fail(folder / "motion.json", error.what());
  }
  truth.body = ReadSurface(folder / "body.ply");
  return truth;
}

std::optional<Pose> TruePoseAt(std::span<const StampedPose> trajectory, double time_s) {
  constexpr double kMaxGap_s = 0.1;
  const auto after =
      std::lower_bound(trajectory.begin(), trajectory.end(), time_s,
                       [](const StampedPose& pose, double t) { return pose.time_s < t; });
  if (after == trajectory.end() || (after == trajectory.begin() && after->time_s > time_s))
    return std::nullopt;
  if (after->time_s == time_s) return after->T_world_camera;
  const auto before = after - 1;
  const double gap_s = after->time_s - before->time_s;
  if (gap_s > kMaxGap_s) return std::nullopt;
  return Interpolate(before->T_world_camera, after->T_world_camera,
                     (time_s - before->time_s) / gap_s);
}

}  // namespace plumb
