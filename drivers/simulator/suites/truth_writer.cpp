// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/suites/truth_writer.hpp"

#include <cmath>
#include <cstring>
#include <iterator>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/statistics.hpp"
#include "algo/types/marker.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb::simulated {
namespace {

using nlohmann::json;

constexpr double kTruthRate_hz = 500.0;
constexpr double kMargin_s = 0.15;  // after the last frame, for its delays

json ToJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

json ToJson(const Pose& T) {
  json rows = json::array();
  for (int row = 0; row < 4; ++row)
    rows.push_back(
        {T.matrix()(row, 0), T.matrix()(row, 1), T.matrix()(row, 2), T.matrix()(row, 3)});
  return rows;
}

std::string TrajectoryText(const SimulatedSource& source) {
  std::string text = "# timestamp tx ty tz qx qy qz qw\n";
  const double duration = source.sweep().num_frames / source.sweep().rate_hz + kMargin_s;
  for (int i = 0; i < static_cast<int>(std::lround(duration * kTruthRate_hz)); ++i) {
    const double time = source.sweep().start_time_s + i / kTruthRate_hz;
    const Pose T = source.T_world_camera(time);
    const Eigen::Vector3d t = T.translation();
    const Eigen::Quaterniond q(T.linear());
    fmt::format_to(std::back_inserter(text),
                   "{:.6f} {:.7f} {:.7f} {:.7f} {:.9f} {:.9f} {:.9f} {:.9f}\n", time, t.x(), t.y(),
                   t.z(), q.x(), q.y(), q.z(), q.w());
  }
  return text;
}

json Markers(const ScenePlan& scene) {
  json markers;
  for (const Board& board : scene.boards) {
    const MarkerCorners corners = CornersOf(board);
    json in_paper_order = json::array();
    for (const std::size_t detector_corner : {3, 2, 1, 0})
      in_paper_order.push_back(ToJson(corners[detector_corner]));
    markers[std::to_string(board.id)] = {{"T_world_marker", ToJson(board.T_world_marker)},
                                         {"corners", in_paper_order}};
  }
  json pushed = nullptr;
  if (scene.sweep.events.pushed) {
    const PushedBoard& event = *scene.sweep.events.pushed;
    pushed = {{"id", scene.boards[event.board].id},
              {"begin_s", scene.sweep.start_time_s + event.begin_s},
              {"end_s", scene.sweep.start_time_s + event.end_s},
              {"T_world_marker_after", ToJson(event.T_world_after)}};
  }
  return {
      {"about",
       "corners in world metres, paper order c1(-l/2,-l/2) c2(l/2,-l/2) c3(l/2,l/2) "
       "c4(-l/2,l/2) in the marker frame (x right, y up on the "
       "printed sheet, z out of the paper); these are OpenCV detector corners 3,2,1,0; as they lie "
       "when the sweep begins"},
      {"dictionary", kDictionary},
      {"length", kMarkerLength},
      {"pushed", pushed},
      {"markers", markers}};
}

// The 90th percentile of the rise, along the normal, over the surface that rises by over 1 mm.
double RiseOf(const Breath& breath, const BodyModel& body) {
  std::vector<float> rises_m;
  for (const Eigen::Vector3f& vertex : body.surface.vertices) {
    const float rise_m =
        breath.levels.front()->Distance(vertex) - breath.levels.back()->Distance(vertex);
    if (rise_m > 0.001F) rises_m.push_back(rise_m);
  }
  return rises_m.empty() ? 0.0 : static_cast<double>(TakeQuantile(rises_m, 0.9));
}

json Motion(const SuitePlan& plan, const ScenePlan& scene) {
  const Pose T_world_body0 = plan.scenes.front().T_world_body;
  const Pose T_world_reference_marker = plan.room.boards.front().T_world_marker;
  const Pose motion = scene.T_world_body * T_world_body0.inverse();
  const Eigen::Vector3d centroid = plan.scenes.front().body->centroid;
  json breathing = nullptr;
  if (const std::optional<Breath>& breath = scene.sweep.events.breath) {
    breathing = {{"amplitude_m", RiseOf(*breath, *scene.body)},
                 {"chest_m", breath->chest_m},
                 {"belly_m", breath->belly_m},
                 {"period_s", breath->period_s}};
  }
  return {
      {"about",
       "motion_*: rigid transform from the placement of the suite's first scene (body0) to "
       "this scene's; centroid = area centroid of the "
       "undeformed body's surface; breathing: rise from exhaled to inhaled, amplitude_m along the "
       "surface's normal at the 90th percentile of what rises by over 1 mm"},
      {"breathing", breathing},
      {"T_world_body", ToJson(scene.T_world_body)},
      {"T_world_body0", ToJson(T_world_body0)},
      {"T_world_reference_marker", ToJson(T_world_reference_marker)},
      {"centroid_body", ToJson(centroid)},
      {"centroid_world", ToJson(scene.T_world_body * centroid)},
      {"motion_reference_marker",
       ToJson(T_world_reference_marker.inverse() * motion * T_world_reference_marker)},
      {"motion_world", ToJson(motion)}};
}

json ToJson(const Intrinsics& camera) {
  return {{"fx", camera.fx},
          {"fy", camera.fy},
          {"cx", camera.cx},
          {"cy", camera.cy},
          {"distortion", LensCoefficients(camera)}};
}

void Append(std::vector<std::uint8_t>& bytes, const void* data, std::size_t size) {
  const auto* begin = static_cast<const std::uint8_t*>(data);
  bytes.insert(bytes.end(), begin, begin + size);
}

std::vector<std::uint8_t> BodyPly(const ScenePlan& scene, const std::vector<int>& sightings) {
  const TriangleMesh& mesh = scene.body->surface;
  const std::string header = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment true surface, world frame, metres; seen = "
      "frames that measured the vertex\n"
      "element vertex {}\nproperty float x\nproperty float y\nproperty float z\nproperty float "
      "seen\nelement face {}\n"
      "property list uchar int vertex_indices\nend_header\n",
      mesh.vertices.size(), mesh.triangles.size());
  std::vector<std::uint8_t> bytes(header.begin(), header.end());
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Eigen::Vector3f p = (scene.T_world_body * mesh.vertices[i].cast<double>()).cast<float>();
    const auto seen = static_cast<float>(sightings[i]);
    Append(bytes, p.data(), 3 * sizeof(float));
    Append(bytes, &seen, sizeof(seen));
  }
  for (const auto& triangle : mesh.triangles) {
    bytes.push_back(3);
    Append(bytes, triangle.data(), 3 * sizeof(std::uint32_t));
  }
  return bytes;
}

}  // namespace

double BellyHeight(const LiveScript& script, double time_s) {
  const DistanceGrid shape = script.ShapeAt(time_s);
  constexpr float kAbove_m = 0.5F;
  const auto height = [&](const DistanceGrid& grid) {
    float highest = 0.0F;
    for (float x = -0.06F; x <= 0.22F; x += 0.01F) {
      for (float y = -0.08F; y <= 0.08F; y += 0.01F) {
        const float t = grid.Intersect(Eigen::Vector3f(x, y, kAbove_m), -Eigen::Vector3f::UnitZ(),
                                       0.0F, kAbove_m);
        highest = std::max(highest, kAbove_m - t);
      }
    }
    return static_cast<double>(highest);
  };
  return height(shape) - height(*script.exhaled);
}

VertexSightings::VertexSightings(const SuitePlan& plan, std::size_t scene)
    : plan_(plan), scene_(plan.scenes.at(scene)) {
  const TriangleMesh& mesh = scene_.body->surface;
  for (const Eigen::Vector3f& vertex : mesh.vertices)
    vertices_in_world_.push_back(scene_.T_world_body * vertex.cast<double>());
  for (const Eigen::Vector3f& normal : mesh.normals)
    normals_in_world_.push_back(scene_.T_world_body.linear() * normal.cast<double>());
  counts_.assign(mesh.vertices.size(), 0);
}

void VertexSightings::Add(const FrameTruth& truth) {
  constexpr double kSame =
      0.010;  // Tolerance in metres between the true depth at the pixel and that of the vertex.
  const Pose T_depth_world =
      (truth.T_world_camera_at_depth * plan_.unit.T_color_depth_true).inverse();
  const Eigen::Vector3d centre = T_depth_world.inverse().translation();
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    if (normals_in_world_[i].dot(centre - vertices_in_world_[i]) <= 0) continue;
    const Eigen::Vector3d p = T_depth_world * vertices_in_world_[i];
    if (p.z() <= 0) continue;
    const Eigen::Vector2d pixel = Project(plan_.unit.depth_true, p);
    const int x = static_cast<int>(std::floor(pixel.x() + 0.5));
    const int y = static_cast<int>(std::floor(pixel.y() + 0.5));
    if (x < 0 || y < 0 || x >= truth.depth.true_m.cols || y >= truth.depth.true_m.rows) continue;
    if (truth.depth.measured_m.at<float>(y, x) > 0 &&
        std::abs(truth.depth.true_m.at<float>(y, x) - p.z()) < kSame)
      ++counts_[i];
  }
}

void WriteTruth(const std::filesystem::path& folder, const SuitePlan& plan, std::size_t scene,
                const SimulatedSource& source, const std::vector<int>& vertex_sightings) {
  const ScenePlan& planned = plan.scenes.at(scene);
  WriteWholeFile(folder / "groundtruth.txt", TrajectoryText(source));
  WriteWholeFile(folder / "markers.json", Markers(planned).dump(1));
  WriteWholeFile(folder / "motion.json", Motion(plan, planned).dump(1));
  WriteWholeFile(folder / "body.ply", BodyPly(planned, vertex_sightings));
}

void WriteTruth(const std::filesystem::path& folder, const SuitePlan& plan, const CtPlan& ct) {
  const ScenePlan scene{ct.name, ct.body, ct.T_world_body, {}, plan.room.boards};
  WriteWholeFile(folder / "groundtruth.txt",
                 std::string_view("# a CT has no camera\n0.0 0 0 1 1 0 0 0\n1.0 0 0 1 1 0 0 0\n"));
  WriteWholeFile(folder / "markers.json", Markers(scene).dump(1));
  WriteWholeFile(folder / "motion.json", Motion(plan, scene).dump(1));
  // All of it was measured.
  WriteWholeFile(folder / "body.ply",
                 BodyPly(scene, std::vector<int>(ct.body->surface.vertices.size(), 1000)));
}

void WriteRoom(const std::filesystem::path& suite, const SuitePlan& plan) {
  const Pose T_world_reference = plan.room.boards.front().T_world_marker;
  const Eigen::Matrix4d T = (plan.T_iec_world * T_world_reference).matrix();
  std::string text = "[iec]\nT_iec_reference = [";
  for (int row = 0; row < 4; ++row)
    text += fmt::format("{}[{:.9f}, {:.9f}, {:.9f}, {:.9f}]", row == 0 ? "" : ", ", T(row, 0),
                        T(row, 1), T(row, 2), T(row, 3));
  text += "]\nu95_mm = 0.0\nu95_deg = 0.0\nmarkers = \"room\"\n";
  WriteWholeFile(suite / "room.toml", std::string_view(text));
  json corners = json::object();
  for (const Board& board : plan.room.boards) {
    json& marker = corners[std::to_string(board.id)] = json::array();
    for (const Eigen::Vector3d& corner : CornersOf(board))
      marker.push_back(ToJson(T_world_reference.inverse() * corner));
  }
  const json scene{{"format", 1},
                   {"preset", "best"},
                   {"frame", "reference_marker"},
                   {"marker_dictionary", kDictionary},
                   {"marker_length_m", kMarkerLength},
                   {"reference_marker", plan.reference_marker},
                   {"markers", corners},
                   {"heightmap", nullptr},
                   {"keyframes", 0},
                   {"frames", {{"total", 0}, {"tracked", 0}, {"dropped", 0}}}};
  WriteWholeFile(suite / "room" / "scene.json", scene.dump(1));
}

LiveTruth::LiveTruth(const ScenePlan& scene)
    : scene_(scene),
      text_("time_s,tx,ty,tz,qx,qy,qz,qw,belly_mm,chest_mm,sensor_moved,passing\n") {}

void LiveTruth::Add(const FrameTruth& truth) {
  const LiveScript& script = *scene_.sweep.events.live;
  const double time_s = truth.depth_time_s - scene_.sweep.start_time_s;
  const Pose T = script.BodyAt(time_s);
  const Eigen::Vector3d t = T.translation();
  const Eigen::Quaterniond q(T.linear());
  bool passing = false;
  for (const LiveScript::Passing& arm : script.passing)
    passing = passing || (time_s >= arm.begin_s && time_s <= arm.end_s);
  const bool moved = time_s >= scene_.sweep.motion.at_rest->pushed_at_s;
  fmt::format_to(
      std::back_inserter(text_),
      "{:.6f},{:.8f},{:.8f},{:.8f},{:.10f},{:.10f},{:.10f},{:.10f},{:.4f},{:.4f},{},{}\n",
      truth.depth_time_s, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w(),
      BellyHeight(script, time_s) * 1e3, script.ChestAt(time_s) * 1e3, moved ? 1 : 0,
      passing ? 1 : 0);
}

void LiveTruth::Write(const std::filesystem::path& folder, const SuitePlan& plan) const {
  WriteWholeFile(folder / "live.csv", text_);
  const ScenePlan& swept = plan.scenes.at(plan.num_sweeps - 1);
  const json about{
      {"about",
       "live.csv: T_world_body as translation (m) and quaternion at the depth image's time; "
       "belly_mm: height of the belly's highest point above that at the end of expiration"},
      {"scene", swept.name},
      {"reference", plan.scenes.front().name},
      {"T_world_body", ToJson(scene_.sweep.events.live->T_world_body)},
      {"T_world_reference_marker", ToJson(plan.room.boards.front().T_world_marker)},
      {"T_world_camera", ToJson(scene_.sweep.motion.at_rest->T_world_camera)}};
  WriteWholeFile(folder / "live.json", about.dump(1));
}

void WriteUnit(const std::filesystem::path& file, const SensorUnit& unit) {
  const DepthBend& bend = unit.depth_bend;
  const json depth{{"scale", unit.depth_scale_error},
                   {"offset_m", unit.depth_offset_m},
                   {"bow_per_m", unit.depth_bow_per_m},
                   {"tilt_per_m", unit.depth_tilt_per_m},
                   {"radial", bend.radial},
                   {"radial_quartic_share", bend.radial_quartic},
                   {"field_rms", bend.field_rms},
                   {"field_change_rms", bend.change_rms}};
  const json warm_up{{"scale", unit.warm_up}, {"on_before_s", unit.on_before_s}};
  const json times{{"exposure_s", unit.exposure_s},
                   {"color_readout_s", unit.readout_s},
                   {"depth_readout_s", unit.depth_readout_s},
                   {"depth_delay_s", unit.depth_delay_s},
                   {"color_stamp_bias_s", unit.color_stamp_bias_s},
                   {"stamp_jitter_s", unit.stamp_jitter_s}};
  const json tone{
      {"kind", Name(unit.tone.kind)}, {"gamma", unit.tone.gamma}, {"contrast", unit.tone.contrast}};
  json lens_rest{{"prism", unit.color_lens_rest.prism}, {"k4", unit.color_lens_rest.k4}};
  if (unit.color_lens_rest.equidistant)
    lens_rest["equidistant"] = *unit.color_lens_rest.equidistant;
  const json written{{"unit", unit.seed},
                     {"faults", unit.faults.Names()},
                     {"color", ToJson(unit.color_true)},
                     {"color_written", ToJson(unit.color_written)},
                     {"infrared", ToJson(unit.depth_true)},
                     {"infrared_assumed", ToJson(unit.depth_assumed)},
                     {"T_color_depth", ToJson(unit.T_color_depth_true)},
                     {"T_color_depth_assumed", ToJson(unit.T_color_depth_assumed)},
                     {"lens_rest", lens_rest},
                     {"depth", depth},
                     {"warm_up", warm_up},
                     {"speckle", unit.speckle},
                     {"times", times},
                     {"tone_curve", tone}};
  WriteWholeFile(file, written.dump(1));
}

}  // namespace plumb::simulated
