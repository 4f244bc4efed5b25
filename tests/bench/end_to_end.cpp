// SPDX-License-Identifier: Apache-2.0
// The end-to-end table: what one scan and one comparison cost, with the accuracy they gave, beside
// the paper and its peers.
//
//   plumb_bench_end_to_end [SUITE_DIR] [--repeats N]
//
// Without a suite, a demo suite is simulated (150 frames a scene, nominal noise). Prints Markdown.
// CPU seconds count all threads; image decoding is left out (frames are decoded beforehand). Run it
// on an idle machine.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "algo/comparison/comparison.hpp"
#include "algo/published/global_icp.hpp"
#include "algo/published/paper_reconstruction.hpp"
#include "algo/reconstruction/reconstructor.hpp"
#include "daemon/evaluation/evaluation.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "daemon/result/result_folder.hpp"
#include "drivers/simulator/suites/suite.hpp"
#include "tests/bench/measured_run.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kPaperKeyframes = 15;
constexpr int kPaperIterations = 50;

/// Values of one row over the repeats.
struct Samples {
  std::vector<double> cpu, wall;
  void Add(const Cost& cost) {
    cpu.push_back(cost.cpu_s);
    wall.push_back(cost.wall_s);
  }
};

std::string Spread(const std::vector<double>& values, double unit, const char* name) {
  if (values.empty()) return "";
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return fmt::format("{:.3g} {} ({:.3g}-{:.3g})", Summarise(values).median / unit, name,
                     *low / unit, *high / unit);
}

std::string InSeconds(const std::vector<double>& values) { return Spread(values, 1.0, "s"); }
std::string InMilliseconds(const std::vector<double>& values) { return Spread(values, 1e-3, "ms"); }

struct ScanCosts {
  Samples tracking_per_frame, after_last_frame;
  std::vector<double> slowest_5_percent_s;  // wall, one a repeat
  std::map<std::string, std::vector<double>> timings_s;
};

Scene RunOnce(const Recorded& recorded, Preset preset, ScanCosts& costs) {
  ReconstructorOptions options;
  options.preset = preset;
  options.now_s = SteadySeconds;
  Reconstructor reconstructor(recorded.info, options);
  std::vector<double> walls;
  const Cost tracking = Measure([&] {
    for (const Frame& frame : recorded.frames)
      walls.push_back(Measure([&] { (void)reconstructor.AddFrame(frame); }).wall_s);
  });
  const auto num_frames = static_cast<double>(recorded.frames.size());
  costs.tracking_per_frame.Add(
      {.cpu_s = tracking.cpu_s / num_frames, .wall_s = tracking.wall_s / num_frames});
  costs.slowest_5_percent_s.push_back(Summarise(walls).p95);
  Scene scene;
  costs.after_last_frame.Add(Measure([&] { scene = reconstructor.Finish(); }));
  for (const auto& [key, value] : scene.timings_s) costs.timings_s[key].push_back(value);
  return scene;
}

/// Evenly spread tracked frames as keyframes in the scene's frame.
std::vector<Keyframe> EvenKeyframes(const Recorded& recorded, const Scene& scene) {
  std::vector<Keyframe> keyframes;
  for (std::size_t i = 0; i < kPaperKeyframes && !scene.trajectory.empty(); ++i) {
    const StampedPose& pose =
        scene.trajectory[i * (scene.trajectory.size() - 1) / (kPaperKeyframes - 1)];
    const auto frame =
        std::find_if(recorded.frames.begin(), recorded.frames.end(),
                     [&](const Frame& f) { return std::abs(f.depth_time_s - pose.time_s) < 1e-5; });
    if (frame == recorded.frames.end()) continue;
    Keyframe keyframe;
    keyframe.frame_index = frame->index;
    keyframe.depth_time_s = frame->depth_time_s;
    keyframe.view = {.intrinsics = recorded.info.intrinsics,
                     .depth_m = frame->depth_m,
                     .color_rgb = {},
                     .T_world_camera = pose.T_world_camera};
    keyframes.push_back(std::move(keyframe));
  }
  return keyframes;
}

/// Largest resident memory of one command, MiB; 0 if it failed.
double PeakMemory(const std::vector<std::string>& arguments) {
  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  std::fflush(nullptr);  // the child must not print what is buffered here once more
  const pid_t child = fork();
  if (child == 0) {
    if (std::freopen("/dev/null", "w", stdout) == nullptr ||
        std::freopen("/dev/null", "w", stderr) == nullptr)
      _exit(127);
    execv(argv[0], argv.data());
    _exit(127);
  }
  int status = 0;
  rusage usage{};
  wait4(child, &status, 0, &usage);
  return status == 0 ? static_cast<double>(usage.ru_maxrss) / 1024.0 : 0.0;
}

void Row(const std::string& item, const std::string& cpu, const std::string& wall,
         const char* paper, const char* peer, const char* goal) {
  fmt::print("| {} | {} | {} | {} | {} | {} |\n", item, cpu, wall, paper, peer, goal);
}

void PrintPaperStages(const Recorded& recorded, const Scene& scene, int repeats) {
  const std::vector<Keyframe> keyframes = EvenKeyframes(recorded, scene);
  Samples clouds_cost, icp_cost, map_cost;
  for (int i = 0; i < repeats; ++i) {
    std::vector<PointCloud> clouds;
    clouds_cost.Add(Measure([&] { clouds = KeyframeClouds(keyframes); }));
    GlobalIcpResult icp;
    icp_cost.Add(Measure([&] { icp = RefinePoses(clouds, {.num_iterations = kPaperIterations}); }));
    map_cost.Add(Measure(
        [&] { (void)HeightMapOfKeyframes(clouds, icp.T_refined_world, Pose::Identity()); }));
  }
  Row(fmt::format("paper: point clouds of {} keyframes", keyframes.size()),
      InSeconds(clouds_cost.cpu), InSeconds(clouds_cost.wall), "3.121 s", "", "");
  Row(fmt::format("paper: Algorithm 1, N = {}, {} keyframes", kPaperIterations, keyframes.size()),
      InSeconds(icp_cost.cpu), InSeconds(icp_cost.wall), "23.083 s", "3.1 CPU s", "0.5 CPU s");
  Row("paper: height map, 1400 x 800 cells", InSeconds(map_cost.cpu), InSeconds(map_cost.wall),
      "3.903 s", "0.09 CPU s", "");
}

void PrintComparison(const Scene& reference, const Scene& current, int repeats,
                     const std::vector<double>& height_map_s) {
  Samples compare_cost, picture_cost;
  for (int i = 0; i < repeats; ++i) {
    Comparison comparison;
    compare_cost.Add(Measure([&] { comparison = Compare(reference, current); }));
    picture_cost.Add(Measure([&] {
      (void)DrawResult(comparison, reference.height_map ? &*reference.height_map : nullptr,
                       {.subtitle = "benchmark"});
    }));
  }
  Row("compare: alignment, motion, deviation", InSeconds(compare_cost.cpu),
      InSeconds(compare_cost.wall), "0.312 s (alignment)", "", "");
  Row("error map and overlay", InSeconds(picture_cost.cpu), InSeconds(picture_cost.wall), "0.256 s",
      "", "");
  const double both_s = Summarise(height_map_s).median + Summarise(picture_cost.wall).median;
  Row("height map and pictures together", "", fmt::format("{:.3g} s", both_s),
      "4.159 s (7.28 s with clouds)", "", "0.15 s");
}

void PrintAccuracy(const Suite& suite, const std::map<std::string, Scene>& scenes) {
  EvaluateOptions options;
  options.get_scene = [&](const std::string& name) { return scenes.at(name); };
  const Evaluation evaluation = EvaluateSuite(suite, options);
  const MotionStatistics total = evaluation.Total();
  fmt::print(
      "\nAccuracy of the same runs\n\n| figure | ours | paper | best peer here | goal "
      "|\n|---|---|---|---|---|\n");
  const std::string motion =
      total.translation_mm.count == 0
          ? "no motion"
          : fmt::format("{:.2f} mm / {:.2f} deg", total.translation_mm.median,
                        total.rotation_deg.median);
  fmt::print(
      "| motion of the body, median of {} pair(s) | {} | 10.5 mm / 1.2 deg | 10.2 mm / 1.17 deg | "
      "1 mm / 0.1 deg |\n",
      total.num_pairs, motion);
  for (const SceneEvaluation& scene : evaluation.scenes) {
    if (scene.trajectory) {
      fmt::print(
          "| ATE RMSE and drift, {}, all frames | {:.2f} mm, {:.1f} mm | | 2.2-2.4 mm, 6-9 mm "
          "(ideal lens); 13.9 mm (nominal) | 1 mm, 2 mm "
          "|\n",
          scene.name, scene.trajectory->rmse_mm, scene.trajectory->drift_mm);
    }
    if (scene.heights) {
      fmt::print(
          "| heights of the body, {}: bias, median, 95th | {:.2f}, {:.2f}, {:.2f} mm | | | |\n",
          scene.name, scene.heights->bias_mm, scene.heights->median_abs_mm, scene.heights->p95_mm);
    }
  }
}

int Main(const std::vector<std::string>& arguments) {
  fs::path suite_folder;
  int repeats = 3;
  for (std::size_t i = 1; i < arguments.size(); ++i) {
    if (arguments[i] == "--repeats" && i + 1 < arguments.size()) {
      repeats = std::max(1, std::atoi(arguments[++i].c_str()));
    } else {
      suite_folder = arguments[i];
    }
  }
  const fs::path work = fs::temp_directory_path() / fmt::format("plumb_bench_{}", getpid());
  fs::create_directories(work);
  if (suite_folder.empty()) {
    SimulateOptions simulate;
    simulate.out = suite_folder = work / "suite";
    SimulateSuite(simulate);
  }
  const Suite suite = OpenSuite(suite_folder);
  // First, while this process is small: a child's largest memory counts what it shared with its
  // parent when it was made.
  const double peak =
      PeakMemory({PLUMB_BINARY, "reconstruct", suite.recordings.at(suite.scenes.front()), "--out",
                  work / "scene"});
  std::map<std::string, Scene> scenes;
  const Recorded recorded = Load(suite.recordings.at(suite.scenes.front()));
  ScanCosts costs;
  for (int i = 0; i < repeats; ++i)
    scenes[suite.scenes.front()] = RunOnce(recorded, Preset::kBest, costs);
  for (std::size_t i = 1; i < suite.scenes.size(); ++i) {
    ScanCosts ignored;
    scenes[suite.scenes[i]] =
        RunOnce(Load(suite.recordings.at(suite.scenes[i])), Preset::kBest, ignored);
  }

  fmt::print(
      "Suite `{}`, scene `{}`: {} frames of {} x {}, {} keyframes; median (range) of {} runs, {} "
      "processors\n\n",
      suite.name, suite.scenes.front(), recorded.frames.size(), recorded.info.intrinsics.width,
      recorded.info.intrinsics.height, scenes.at(suite.scenes.front()).keyframes.size(), repeats,
      sysconf(_SC_NPROCESSORS_ONLN));
  fmt::print(
      "| item | CPU | wall | paper (i7-4700HQ) | best peer here | goal "
      "|\n|---|---|---|---|---|---|\n");
  Row("tracking, per frame", InMilliseconds(costs.tracking_per_frame.cpu),
      InMilliseconds(costs.tracking_per_frame.wall), "real time", "19-21 CPU ms", "8 CPU ms");
  Row("tracking, 95th percentile of frames", "", InMilliseconds(costs.slowest_5_percent_s), "", "",
      "15 ms");
  Row("last frame to scene", InSeconds(costs.after_last_frame.cpu),
      InSeconds(costs.after_last_frame.wall), "30.679 s", "", "1 s");
  for (const char* stage : {"clouds", "global_registration", "markers", "height_map", "mesh"}) {
    if (costs.timings_s.contains(stage))
      Row(fmt::format("- {}", stage), "", InSeconds(costs.timings_s.at(stage)), "", "", "");
  }
  PrintPaperStages(recorded, scenes.at(suite.scenes.front()), repeats);
  if (!suite.pairs.empty()) {
    PrintComparison(scenes.at(suite.pairs.front().first), scenes.at(suite.pairs.front().second),
                    repeats, costs.timings_s["height_map"]);
  }
  Row("peak memory of `plumb reconstruct`", "", fmt::format("{:.0f} MiB", peak), "", "", "600 MB");
  PrintAccuracy(suite, scenes);
  fs::remove_all(work);
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  try {
    return plumb::Main({argv, argv + argc});
  } catch (const std::exception& error) {
    fmt::print(stderr, "plumb_bench_end_to_end: {}\n", error.what());
    return 1;
  }
}
