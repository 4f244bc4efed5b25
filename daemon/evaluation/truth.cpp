// SPDX-License-Identifier: Apache-2.0
#include "daemon/evaluation/truth.hpp"

#include <algorithm>
#include <fstream>
#include <sstream>
#include <utility>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "daemon/files/ply_file.hpp"
#include "words/evaluation.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::size_t kMaxFileBytes = std::size_t{512} << 20;

[[noreturn]] void Fail(const fs::path& file, const Message& what) {
  throw DataError(say::evaluation::TruthFile(file.string(), what));
}

std::string ReadWhole(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) Fail(file, say::evaluation::TruthMissing());
  std::error_code error;
  const std::uintmax_t size = fs::file_size(file, error);
  if (error || size > kMaxFileBytes)
    Fail(file, say::evaluation::TruthTooLarge(kMaxFileBytes >> 20));
  std::string text(static_cast<std::size_t>(size), '\0');
  in.read(text.data(), static_cast<std::streamsize>(size));
  if (in.gcount() != static_cast<std::streamsize>(size))
    Fail(file, say::evaluation::TruthEndsEarly());
  return text;
}

json ReadJson(const fs::path& file) {
  const std::string text = ReadWhole(file);
  try {
    return ParseBoundedJson(text);
  } catch (const DataError& error) {
    Fail(file, MessageOf(error));
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
      Fail(file, say::evaluation::PoseLine(number));
    }
    const Eigen::Quaterniond q(qw, qx, qy, qz);
    if (!(q.norm() > 0.5)) Fail(file, say::evaluation::Quaternion(number));
    if (!trajectory.empty() && !(t > trajectory.back().time_s))
      Fail(file, say::evaluation::RisingTimes(number));
    StampedPose pose{.time_s = t};
    pose.T_world_camera.linear() = q.normalized().toRotationMatrix();
    pose.T_world_camera.translation() = Eigen::Vector3d(x, y, z);
    trajectory.push_back(pose);
  }
  if (trajectory.size() < 2) Fail(file, say::evaluation::FewPoses());
  return trajectory;
}

// Vertices without the number of frames that measured them count as seen often enough.
TrueSurface ReadSurface(const fs::path& file) {
  constexpr float kSeenOftenEnough = 1e9F;
  const std::string data = ReadWhole(file);
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(data.data()), data.size());
  TriangleMesh mesh = ParseMeshPly(bytes, file.string());
  TrueSurface surface;
  for (const Eigen::Vector3f& vertex : mesh.vertices)
    surface.vertices_world.push_back(vertex.cast<double>());
  surface.triangles = std::move(mesh.triangles);
  surface.frames_seen = ParseVertexProperty(bytes, file.string(), "seen");
  surface.frames_seen.resize(surface.vertices_world.size(), kSeenOftenEnough);
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
    Fail(folder / "markers.json", MessageOf(error));
  }
  try {
    truth.T_world_body = ToPose(motion.at("T_world_body"));
    truth.T_world_reference_marker = ToPose(motion.at("T_world_reference_marker"));
    for (int i = 0; i < 3; ++i)
      truth.centroid_body[i] =
          motion.at("centroid_body").at(static_cast<std::size_t>(i)).get<double>();
    if (const auto breathing = motion.find("breathing");
        breathing != motion.end() && !breathing->is_null())
      truth.breathing_m = breathing->at("amplitude_m").get<double>();
  } catch (const std::exception& error) {
    Fail(folder / "motion.json", MessageOf(error));
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
