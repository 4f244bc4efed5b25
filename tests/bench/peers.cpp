// SPDX-License-Identifier: Apache-2.0
// Plumb's joint registration beside Open3D's and PCL's, on the same keyframes.
//
//   plumb_bench_peers SUITE [SCENE...]     the first scene if none is named
//   plumb_bench_peers RECORDING TRUTH
//   plumb_bench_peers --scene METHOD RECORDING SCENE
//
// The last one writes the scene that a peer makes of a recording, for the open benchmark: METHOD is
// open3d or pcl, and no truth is read. See PeerScene().
//
// Prints a Markdown table for each scene. All rows start from the poses that Plumb's tracker gave
// the keyframes, and use their depth images corrected by the stated calibration only. Differences
// that the table does not show:
// - The peers do not model the sensor: neither errors of its calibration nor its rolling shutter
//   nor the delay between colour and depth. Plumb estimates these together with the poses.
// - Markers and keypoints enter the peers by the tracker's poses only. RegisterJointly() uses them
//   once more, and knows the markers' true size.
// - Time counts the solution alone, with what the method makes of the clouds for itself (voxels,
//   normals, its own view of the depth images); the clouds themselves are made beforehand. Plumb's
//   includes measuring the markers again with the camera's tone curve.
// CPU seconds count all threads. OpenMP's threads, which Open3D uses, spend some while they wait
// for each other: set OMP_WAIT_POLICY=passive, and run on an idle machine.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>
#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "algo/geometry/back_projection.hpp"
#include "algo/published/global_icp.hpp"
#include "algo/published/paper_reconstruction.hpp"
#include "algo/reconstruction/reconstructor.hpp"
#include "algo/reconstruction/trajectory.hpp"
#include "algo/registration/joint_registration.hpp"
#include "algo/surface/height_maps.hpp"
#include "algo/surface/surface_cloud.hpp"
#include "algo/tracking/tracker.hpp"
#include "daemon/evaluation/evaluation.hpp"
#include "daemon/files/scene_folder.hpp"
#include "tests/bench/measured_run.hpp"
#include "tests/bench/peers.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kPaperKeyframes = 15;
constexpr int kPaperIterations = 50;
constexpr double kMinFramesSeen = 3.0;  // As EvaluateOptions.

struct SceneFolders {
  std::string name;
  fs::path recording, truth;
};

/// One line of the table. `heights` are in the true reference marker's frame.
struct Row {
  std::string name;
  std::optional<Cost> cost;
  std::vector<StampedPose> path;
  std::optional<HeightMap> heights;
};

/// Keyframes with depth, at the poses of the tracker.
std::vector<Keyframe> TrackedKeyframes(const Recorded& recorded) {
  Tracker tracker(recorded.info, {});
  for (const Frame& frame : recorded.frames) (void)tracker.Track(frame);
  std::vector<TrackedFrame> frames = tracker.frames();
  TrackingMap map = tracker.TakeMap();
  if (map.keyframes.size() >= 2) RefreshVelocities(frames, map);
  std::vector<Keyframe> keyframes;
  for (const MapKeyframe& keyframe : map.keyframes) {
    if (keyframe.is_bare || cv::countNonZero(keyframe.data.view.depth_m) == 0) continue;
    keyframes.push_back(keyframe.data);
    keyframes.back().view.T_world_camera = DepthPose(keyframe, CalibrationModel());
  }
  if (keyframes.size() < 3)
    throw DataError(
        fmt::format("the tracker kept {} keyframes with depth of {} frames, expected at least 3: "
                    "use a recording of a sweep over markers",
                    keyframes.size(), recorded.frames.size()));
  return keyframes;
}

std::vector<Keyframe> EvenlySpread(const std::vector<Keyframe>& keyframes, std::size_t count) {
  if (keyframes.size() <= count) return keyframes;
  std::vector<Keyframe> spread;
  for (std::size_t i = 0; i < count; ++i)
    spread.push_back(keyframes[i * (keyframes.size() - 1) / (count - 1)]);
  return spread;
}

std::vector<Pose> PosesOf(const std::vector<Keyframe>& keyframes) {
  std::vector<Pose> T_world_camera;
  for (const Keyframe& keyframe : keyframes) T_world_camera.push_back(keyframe.view.T_world_camera);
  return T_world_camera;
}

std::vector<StampedPose> PathOf(const std::vector<Keyframe>& keyframes,
                                const std::vector<Pose>& T_world_camera) {
  std::vector<StampedPose> path;
  for (std::size_t k = 0; k < keyframes.size(); ++k)
    path.push_back({keyframes[k].depth_time_s, T_world_camera.at(k)});
  return path;
}

/// The top surface of the keyframes' depth images at new poses. The true marker's frame is where
/// the fit of the path puts it, because only Plumb measures the marker.
HeightMap HeightsAt(std::vector<Keyframe> keyframes, const std::vector<Pose>& T_scene_camera,
                    const Pose& T_marker_scene) {
  std::vector<DepthView> views;
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    views.push_back(std::move(keyframes[k].view));
    views.back().color_rgb.release();
    views.back().T_world_camera = T_marker_scene * T_scene_camera[k];
  }
  return RobustHeightMap(PrepareViews(views, {}));
}

Row RowOfPoses(const std::string& name, const std::optional<Cost>& cost,
               const std::vector<Keyframe>& keyframes, const std::vector<Pose>& T_scene_camera,
               const SceneTruth& truth) {
  Row row{.name = name, .cost = cost, .path = PathOf(keyframes, T_scene_camera), .heights = {}};
  if (const auto error = ErrorOfTrajectory(row.path, truth))
    row.heights = HeightsAt(keyframes, T_scene_camera,
                            truth.T_world_reference_marker.inverse() * error->T_world_scene);
  return row;
}

/// Preset `best` as a whole, of which only the joint registration is measured: what runs between
/// these two reports of progress.
Row RunBest(const Recorded& recorded, const std::vector<Keyframe>& keyframes) {
  Reconstructor reconstructor(recorded.info, {});
  for (const Frame& frame : recorded.frames) (void)reconstructor.AddFrame(frame);
  Cost before, after;
  Scene scene = reconstructor.Finish({}, [&](double, const Message& stage) {
    const Cost now{.cpu_s = CpuSeconds(), .wall_s = SteadySeconds()};
    if (stage.id() == "progress.markers") before = now;
    if (stage.id() == "progress.surface") after = now;
  });
  Row row{.name = "Plumb: `RegisterJointly()`, preset `best`",
          .cost = Cost{.cpu_s = after.cpu_s - before.cpu_s, .wall_s = after.wall_s - before.wall_s},
          .path = {},
          .heights = std::move(scene.height_map)};
  for (const StampedPose& pose : scene.keyframes) {
    if (std::any_of(keyframes.begin(), keyframes.end(),
                    [&](const Keyframe& keyframe) { return keyframe.depth_time_s == pose.time_s; }))
      row.path.push_back(pose);
  }
  if (row.path.size() != keyframes.size())
    throw std::logic_error(
        fmt::format("preset `best` has {} of the {} keyframes that the peers get; the options of "
                    "the tracker in this program no longer agree with the reconstructor's",
                    row.path.size(), keyframes.size()));
  return row;
}

Row RunPaper(const std::vector<Keyframe>& keyframes, const char* note, const SceneTruth& truth) {
  const std::vector<PointCloud> clouds = KeyframeClouds(keyframes);
  GlobalIcpResult icp;
  const Cost cost =
      Measure([&] { icp = RefinePoses(clouds, {.num_iterations = kPaperIterations}); });
  std::vector<Pose> T_refined_camera = PosesOf(keyframes);
  for (std::size_t k = 0; k < keyframes.size(); ++k)
    T_refined_camera[k] = icp.T_refined_world[k] * T_refined_camera[k];
  return RowOfPoses(
      fmt::format("Plumb: Algorithm 1 of the paper, N = {}{}", kPaperIterations, note), cost,
      keyframes, T_refined_camera, truth);
}

std::vector<PeerMethod> Peers() {
  std::vector<PeerMethod> methods;
#ifdef PLUMB_BENCH_OPEN3D
  methods.push_back(Open3dMethod());
#endif
#ifdef PLUMB_BENCH_PCL
  methods.push_back(PclMethod());
#endif
  return methods;
}

/// The method with a short name; nothing if it is not built in.
std::optional<PeerMethod> PeerNamed(const std::string& name) {
#ifdef PLUMB_BENCH_OPEN3D
  if (name == "open3d") return Open3dMethod();
#endif
#ifdef PLUMB_BENCH_PCL
  if (name == "pcl") return PclMethod();
#endif
  return std::nullopt;
}

std::vector<PeerView> ViewsForPeers(const std::vector<Keyframe>& keyframes) {
  RayTables tables;
  std::vector<PeerView> views;
  for (const Keyframe& keyframe : keyframes) {
    DepthView view = keyframe.view;
    view.color_rgb.release();
    views.push_back({BackProject(view, *tables.For(view.intrinsics)), view.T_world_camera});
  }
  return views;
}

/// The published chain with a peer's registration in the place of Algorithm 1, and with as many
/// keyframes as the tracker gives: markers are averaged over the keyframes, and the reference
/// marker gives the frame. The surface is Plumb's, as in every row of this program.
Scene PeerScene(const Recorded& recorded, const PeerMethod& method) {
  std::vector<Keyframe> keyframes = TrackedKeyframes(recorded);
  const std::vector<Pose> T_peer_camera = method.solve(ViewsForPeers(keyframes));
  std::vector<Pose> T_peer_world;
  for (std::size_t k = 0; k < keyframes.size(); ++k)
    T_peer_world.push_back(T_peer_camera.at(k) * keyframes[k].view.T_world_camera.inverse());
  Scene scene;
  scene.preset = Preset::kPaper;
  scene.room_markers = recorded.info.room_markers;
  scene.depth_sensor = recorded.info.depth_sensor;
  scene.frames_total = static_cast<std::int64_t>(recorded.frames.size());
  scene.frames_tracked = scene.frames_total;
  scene.markers = AverageMarkers(keyframes, T_peer_world);
  const std::optional<Pose> T_marker_peer = ReferenceFrame(
      scene.markers, scene.room_markers.reference.value_or(-1), scene.room_markers.length_m);
  if (!T_marker_peer)
    throw DataError("no keyframe measured the reference marker in depth at all its corners");
  scene.frame = SceneFrame::kReferenceMarker;
  for (auto& [id, marker] : scene.markers)
    for (Eigen::Vector3d& corner : marker.corners) corner = *T_marker_peer * corner;
  std::vector<DepthView> views;
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    views.push_back(std::move(keyframes[k].view));
    views.back().color_rgb.release();
    views.back().T_world_camera = *T_marker_peer * T_peer_camera[k];
    scene.keyframes.push_back({keyframes[k].depth_time_s, views.back().T_world_camera});
  }
  scene.trajectory = scene.keyframes;
  const std::vector<ViewSurface> surfaces =
      PrepareViews(views, {.min_depth_m = static_cast<float>(recorded.info.usable_depth.nearest_m),
                           .max_depth_m = static_cast<float>(recorded.info.usable_depth.farthest_m),
                           .depth_noise = recorded.info.depth_noise});
  scene.cloud = MergeSurface(surfaces, {.with_colors = false});
  scene.height_map = RobustHeightMap(surfaces);
  return scene;
}

/// @return the exit code.
int WritePeerScene(const std::vector<std::string>& arguments) {
  const std::optional<PeerMethod> method =
      arguments.size() == 3 ? PeerNamed(arguments[0]) : std::nullopt;
  if (!method) {
    fmt::print(stderr,
               "plumb_bench_peers: call plumb_bench_peers --scene METHOD RECORDING SCENE, where "
               "METHOD is open3d or pcl, as this program was built with\n");
    return 2;
  }
  WriteScene(PeerScene(Load(arguments[1]), *method), arguments[2]);
  fmt::print("{}: {}\n", method->name, method->parameters);
  return 0;
}

void PrintRow(const Row& row, const SceneTruth& truth) {
  std::string cpu, wall, ate, rotation, scale, left, seen;
  if (row.cost) {
    cpu = fmt::format("{:.2f}", row.cost->cpu_s);
    wall = fmt::format("{:.2f}", row.cost->wall_s);
  }
  if (const auto error = ErrorOfTrajectory(row.path, truth)) {
    ate = fmt::format("{:.2f}", error->rmse_mm);
    rotation = fmt::format("{:.3f}", error->rotation_rmse_deg);
  }
  if (row.heights) {
    const HeightMap true_heights =
        TrueHeights(truth, row.heights->grid, truth.T_world_reference_marker, kMinFramesSeen);
    if (const auto shape = ErrorOfShape(*row.heights, true_heights)) {
      scale = fmt::format("{:+.2f}", shape->scale_permille);
      left = fmt::format("{:.2f}", shape->left.rmse_mm);
    }
    seen = fmt::format("{:.0f}", 100.0 * ErrorOfHeights(*row.heights, true_heights).completeness);
  }
  fmt::print("| {} | {} | {} | {} | {} | {} | {} | {} | {} |\n", row.name, row.path.size(), cpu,
             wall, ate, rotation, scale, left, seen);
  std::fflush(stdout);
}

void PrintHead(const SceneFolders& scene, std::size_t num_frames) {
  fmt::print(
      "Scene `{}`: {} frames, {} processors\n\n"
      "| method | keyframes | CPU (s) | wall (s) | ATE (mm) | rotation RMSE (deg) | scale of the "
      "body (permille) | heights after fit, RMSE (mm) | body seen (%) |\n"
      "|---|---|---|---|---|---|---|---|---|\n",
      scene.name, num_frames, sysconf(_SC_NPROCESSORS_ONLN));
}

void PrintCaption() {
  fmt::print(
      "\nATE: positions of the keyframes after a rigid fit without scale; the rotations after the "
      "same fit. Scale and heights: the body's surface after a fit of position, rotation and "
      "scale, all rows by the same height map; its depth is corrected by the stated calibration, "
      "in the row of preset `best` by the estimated one. The paper states 23.1 s for Algorithm 1 "
      "with N = {} and {} keyframes on an i7-4700HQ. Parameters:\n\n",
      kPaperIterations, kPaperKeyframes);
  for (const PeerMethod& method : Peers()) fmt::print("- {}: {}\n", method.name, method.parameters);
  fmt::print("\n");
}

void PrintScene(const SceneFolders& folders) {
  const SceneTruth truth = ReadSceneTruth(folders.truth);
  const Recorded recorded = Load(folders.recording);
  const std::vector<Keyframe> keyframes = TrackedKeyframes(recorded);
  const std::vector<Keyframe> few = EvenlySpread(keyframes, kPaperKeyframes);
  const auto print = [&](const Row& row) { PrintRow(row, truth); };
  PrintHead(folders, recorded.frames.size());
  print(RowOfPoses("poses of the tracker", std::nullopt, keyframes, PosesOf(keyframes), truth));
  print(RunBest(recorded, keyframes));
  print(RunPaper(keyframes, "", truth));
  const std::vector<PeerView> views = ViewsForPeers(keyframes);
  for (const PeerMethod& method : Peers()) {
    std::vector<Pose> T_world_camera;
    const Cost cost = Measure([&] { T_world_camera = method.solve(views); });
    print(RowOfPoses(method.name, cost, keyframes, T_world_camera, truth));
  }
  print(RowOfPoses("poses of the tracker, as few as the paper's", std::nullopt, few, PosesOf(few),
                   truth));
  print(RunPaper(few, ", as few as the paper's", truth));
  PrintCaption();
}

/// @throws std::invalid_argument stating what is wrong with the command line.
std::vector<SceneFolders> ScenesOf(const std::vector<std::string>& arguments) {
  constexpr const char* kUsage =
      "call plumb_bench_peers SUITE [SCENE...] or plumb_bench_peers RECORDING TRUTH";
  if (arguments.empty())
    throw std::invalid_argument(
        fmt::format("expected a suite or a recording, found nothing: {}", kUsage));
  const fs::path first = arguments.front();
  if (!fs::is_directory(first))
    throw std::invalid_argument(
        fmt::format("'{}': expected the folder of a suite or of a recording, found {}; {}",
                    first.string(), fs::exists(first) ? "a file" : "nothing", kUsage));
  if (!fs::is_directory(first / "truth")) {
    if (arguments.size() != 2)
      throw std::invalid_argument(
          fmt::format("'{}' is no suite, because it has no folder 'truth', and a recording needs "
                      "one more argument, found {}; {}",
                      first.string(), arguments.size() - 1, kUsage));
    if (!fs::is_directory(arguments[1]))
      throw std::invalid_argument(
          fmt::format("'{}': expected the folder of a truth, found {}; {}", arguments[1],
                      fs::exists(arguments[1]) ? "a file" : "nothing", kUsage));
    return {{first.filename().string(), first, arguments[1]}};
  }
  const Suite suite = OpenSuite(first);
  std::vector<std::string> names(arguments.begin() + 1, arguments.end());
  if (names.empty()) names.push_back(suite.scenes.front());
  std::vector<SceneFolders> scenes;
  for (const std::string& name : names) {
    if (!suite.recordings.contains(name))
      throw std::invalid_argument(fmt::format(
          "suite '{}' has no scene '{}', found {}; name one of these, or none for the first",
          first.string(), name, fmt::join(suite.scenes, ", ")));
    scenes.push_back({name, suite.recordings.at(name), suite.truths.at(name)});
  }
  return scenes;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == "--scene") {
    try {
      return plumb::WritePeerScene({argv + 2, argv + argc});
    } catch (const std::exception& error) {
      fmt::print(stderr, "plumb_bench_peers: {}\n", error.what());
      return 1;
    }
  }
  std::vector<plumb::SceneFolders> scenes;
  try {
    scenes = plumb::ScenesOf({argv + 1, argv + argc});
  } catch (const std::exception& error) {
    fmt::print(stderr, "plumb_bench_peers: {}\n", error.what());
    return 2;
  }
  try {
    for (const plumb::SceneFolders& scene : scenes) plumb::PrintScene(scene);
  } catch (const std::exception& error) {
    fmt::print(stderr, "plumb_bench_peers: {}\n", error.what());
    return 1;
  }
  return 0;
}
