// SPDX-License-Identifier: Apache-2.0
#include "daemon/evaluation/evaluation.hpp"

#include <algorithm>
#include <set>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "algo/geometry/rigid_fit.hpp"
#include "drivers/files/file_io.hpp"
#include "words/evaluation.hpp"
#include "words/progress.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr std::size_t kMaxScenes = 1000;

/// Names become folder names, so they must not lead elsewhere.
std::string CheckedName(const Json& value, const fs::path& file) {
  const std::string name = value.is_string() ? value.get<std::string>() : "";
  if (name.empty() || name == "." || name == ".." || name.find('/') != std::string::npos) {
    throw DataError(say::evaluation::SceneName(file.string(), value.dump()));
  }
  return name;
}

void ReadSuiteFile(const fs::path& file, Suite& suite) {
  constexpr std::size_t kMaxBytes = 1 << 20;
  try {
    const Json content = ParseBoundedJson(ReadTextFile(file, kMaxBytes));
    suite.name = content.value("name", suite.name);
    for (const auto& scene : content.at("scenes")) suite.scenes.push_back(CheckedName(scene, file));
    for (const auto& pair : content.at("pairs"))
      suite.pairs.emplace_back(CheckedName(pair.at(0), file), CheckedName(pair.at(1), file));
    for (const auto& name : content.value("live", Json::array()))
      suite.live.push_back(CheckedName(name, file));
    const Json together = content.value("live_together", Json::object());
    for (const auto& [name, recordings] : together.items()) {
      for (const auto& recording : recordings)
        suite.live_together[CheckedName(name, file)].push_back(CheckedName(recording, file));
    }
  } catch (const Json::exception& error) {
    throw DataError(say::evaluation::SuiteFile(
        file.string(), R"({"name", "scenes": [..], "pairs": [[a, b], ..]})", error.what()));
  }
}

void FindScenes(const fs::path& folder, Suite& suite) {
  for (const fs::directory_entry& entry : fs::directory_iterator(folder / "truth")) {
    if (entry.is_directory()) suite.scenes.push_back(entry.path().filename().string());
  }
  std::sort(suite.scenes.begin(), suite.scenes.end());
  std::stable_partition(suite.scenes.begin(), suite.scenes.end(),
                        [](const std::string& name) { return name == "reference"; });
  for (const std::string& reference : suite.scenes) {
    for (const std::string& current : suite.scenes) {
      if (reference != current) suite.pairs.emplace_back(reference, current);
    }
  }
}

/// Marker corners against the truth: their own rigid fit, and the scale that a similarity fit would
/// find.
void MeasureMarkers(const Scene& scene, const SceneTruth& truth, SceneEvaluation& result) {
  std::vector<Eigen::Vector3d> estimated, in_truth;
  for (const auto& [id, marker] : scene.markers) {
    const auto found = truth.markers.find(id);
    if (found == truth.markers.end()) continue;
    estimated.insert(estimated.end(), marker.corners.begin(), marker.corners.end());
    in_truth.insert(in_truth.end(), found->second.begin(), found->second.end());
  }
  if (estimated.size() < 4) return;
  const RigidFit fit = FitRigid(in_truth, estimated);
  Eigen::Vector3d centre_a = Eigen::Vector3d::Zero(), centre_b = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < estimated.size(); ++i)
    centre_a += in_truth[i], centre_b += estimated[i];
  centre_a /= static_cast<double>(estimated.size());
  centre_b /= static_cast<double>(estimated.size());
  double cross = 0, square = 0;
  for (std::size_t i = 0; i < estimated.size(); ++i) {
    const Eigen::Vector3d a = in_truth[i] - centre_a;
    cross += a.dot(fit.T_a_b.linear() * (estimated[i] - centre_b));
    square += a.squaredNorm();
  }
  result.marker_rms_mm = fit.rms_m / kMillimetre;
  result.marker_scale_permille = 1000 * (cross / square - 1);
}

/// The frame of a scene's height map in the world; of a planning CT's by the room as configured.
Pose WorldOfHeights(const Scene& scene, const SceneTruth& truth, const CompareOptions& options) {
  if (!scene.planning || !options.T_iec_reference) return truth.T_world_reference_marker;
  return truth.T_world_reference_marker * options.T_iec_reference->inverse();
}

SceneEvaluation MeasureScene(const std::string& name, const Scene& scene, const SceneTruth& truth,
                             const EvaluateOptions& options) {
  SceneEvaluation result;
  result.name = name;
  result.frames_total = scene.frames_total;
  result.frames_tracked = scene.frames_tracked;
  result.num_keyframes = scene.keyframes.size();
  result.num_markers = scene.markers.size();
  result.keyframes = ErrorOfTrajectory(scene.keyframes, truth);
  result.trajectory = ErrorOfTrajectory(scene.trajectory, truth);
  if (scene.breathing) result.breathing_mm = scene.breathing->amplitude_m / kMillimetre;
  result.true_breathing_mm = truth.breathing_m / kMillimetre;
  result.calibration = scene.calibration;
  result.timings_s = scene.timings_s;
  MeasureMarkers(scene, truth, result);
  result.marker_intervals = CoverageOfMarkers(scene.markers, truth);
  if (scene.height_map) {
    const HeightMap true_heights =
        TrueHeights(truth, scene.height_map->grid, WorldOfHeights(scene, truth, options.compare),
                    options.min_frames_seen);
    result.heights = ErrorOfHeights(*scene.height_map, true_heights);
    result.shape = ErrorOfShape(*scene.height_map, true_heights);
  }
  return result;
}

/// The parts of an evaluated scene that pairs need; other surfaces are dropped.
struct KeptScene {
  Scene scene;
  SceneTruth truth;
  Pose T_world_scene = Pose::Identity();
  bool has_world = false;
};

PairEvaluation MeasurePair(const std::string& reference_name, const std::string& current_name,
                           const KeptScene& reference, const KeptScene& current,
                           const Comparison& comparison, const EvaluateOptions& options) {
  PairEvaluation result;
  result.reference = reference_name;
  result.current = current_name;
  result.verdict = comparison.verdict;
  result.reasons = comparison.reasons;
  result.timings_s = comparison.timings_s;
  const Eigen::Vector3d true_centroid =
      reference.truth.T_world_reference_marker.inverse() * reference.truth.centroid_world();
  result.truth =
      TrueNumbersOf(TrueMotion(reference.truth, current.truth),
                    comparison.correction ? comparison.correction->isocentre_m : true_centroid,
                    options.compare.T_iec_reference.value_or(Pose::Identity()));
  if (comparison.correction) {
    result.numbers = ErrorsOfNumbers(*comparison.correction, result.truth);
  }
  if (comparison.motion)
    result.motion = ErrorOfMotion(comparison.motion->T, reference.truth, current.truth);
  if (comparison.alignment && reference.has_world && current.has_world) {
    result.alignment =
        ErrorOfAlignment(comparison.alignment->T_reference_current, reference.truth, current.truth,
                         reference.T_world_scene, current.T_world_scene);
  }
  if (comparison.deviation) {
    const GridShape& grid = comparison.deviation->grid;
    const Pose T_world_marker = WorldOfHeights(reference.scene, reference.truth, options.compare);
    // The motion in the frame of the grid, where that of a planning CT is another one.
    const Pose T_grid_marker = T_world_marker.inverse() * reference.truth.T_world_reference_marker;
    const double min_seen = options.min_frames_seen;
    HeightMap true_deviation = TrueHeights(current.truth, grid, T_world_marker, min_seen);
    if (comparison.deformation && comparison.motion)
      result.deformation = ErrorOfDeformation(
          *comparison.deformation, T_grid_marker * comparison.motion->T * T_grid_marker.inverse(),
          true_deviation);
    const HeightMap before = TrueHeights(reference.truth, grid, T_world_marker, min_seen);
    for (std::size_t cell = 0; cell < before.z.size(); ++cell)
      true_deviation.z[cell] -= before.z[cell];
    result.deviation = ErrorOfHeights(*comparison.deviation, true_deviation);
  }
  return result;
}

MotionStatistics StatisticsOf(const Evaluation& evaluation,
                              const std::function<bool(const PairEvaluation&)>& counts) {
  MotionStatistics statistics;
  std::vector<double> rotations, translations;
  for (const PairEvaluation& pair : evaluation.pairs) {
    if (!counts(pair)) continue;
    ++statistics.num_pairs;
    if (pair.verdict == Verdict::kNoAnswer) ++statistics.num_no_answer;
    statistics.verdicts.Add(pair.verdict, pair.truth, evaluation.limits);
    if (pair.verdict != Verdict::kNoAnswer && pair.numbers) statistics.intervals.Add(*pair.numbers);
    if (!pair.motion) {
      ++statistics.num_without_motion;
      continue;
    }
    rotations.push_back(pair.motion->rotation_deg);
    translations.push_back(pair.motion->translation_mm);
  }
  statistics.rotation_deg = Summarise(std::move(rotations));
  statistics.translation_mm = Summarise(std::move(translations));
  return statistics;
}

}  // namespace

Suite OpenSuite(const fs::path& folder) {
  if (!fs::is_directory(folder / "truth")) {
    throw DataError(say::evaluation::NotASuite(folder.string()));
  }
  Suite suite;
  suite.name = (folder.filename().empty() ? folder.parent_path() : folder).filename().string();
  if (fs::exists(folder / "suite.json")) {
    ReadSuiteFile(folder / "suite.json", suite);
  } else {
    FindScenes(folder, suite);
  }
  if (suite.scenes.empty() || suite.scenes.size() > kMaxScenes) {
    throw DataError(say::evaluation::SceneCount(folder.string(), kMaxScenes, suite.scenes.size()));
  }
  const std::set<std::string> known(suite.scenes.begin(), suite.scenes.end());
  for (const auto& [reference, current] : suite.pairs) {
    for (const std::string& name : {reference, current}) {
      if (!known.contains(name))
        throw DataError(say::evaluation::UnknownScene(folder.string(), name));
    }
  }
  for (const auto& [together, recordings] : suite.live_together) {
    for (const std::string& name : recordings) {
      if (std::find(suite.live.begin(), suite.live.end(), name) == suite.live.end())
        throw DataError(say::evaluation::UnknownScene(folder.string(), name));
    }
  }
  std::vector<std::string> recorded = suite.scenes;
  recorded.insert(recorded.end(), suite.live.begin(), suite.live.end());
  for (const std::string& name : recorded) {
    const fs::path nested = folder / "recordings" / name;
    const fs::path file = folder / "recordings" / (name + ".oni");
    suite.recordings[name] = fs::is_directory(nested)    ? nested
                             : fs::is_regular_file(file) ? file
                                                         : folder / name;
    suite.truths[name] = folder / "truth" / name;
    for (const fs::path& path : {suite.recordings[name], suite.truths[name]}) {
      if (!fs::is_directory(path) && path != file)
        throw DataError(say::evaluation::NoSceneFolder(folder.string(), name, path.string()));
    }
  }
  return suite;
}

MotionStatistics Evaluation::Total() const {
  return StatisticsOf(*this, [](const PairEvaluation&) { return true; });
}

MotionStatistics Evaluation::OfReference(const std::string& reference) const {
  return StatisticsOf(*this,
                      [&](const PairEvaluation& pair) { return pair.reference == reference; });
}

IntervalCount Evaluation::MarkerIntervals() const {
  IntervalCount sum;
  for (const SceneEvaluation& scene : scenes) {
    sum.count += scene.marker_intervals.count;
    sum.inside += scene.marker_intervals.inside;
  }
  return sum;
}

Evaluation EvaluateSuite(
    const Suite& suite, const EvaluateOptions& options, const std::stop_token& stop,
    const std::function<void(const Message& what, double fraction)>& progress) {
  Evaluation evaluation;
  evaluation.suite = suite.name;
  evaluation.preset = options.compare.preset;
  evaluation.limits = options.compare.limits;
  std::map<std::string, KeptScene> kept, kept_currents;
  for (const std::string& name : suite.scenes) {
    KeptScene& entry = kept[name];
    entry.truth = ReadSceneTruth(
        suite.truths.at(name));  // before the long work, so that a bad truth is reported at once
  }
  const auto measure = [&](const std::string& name, Scene scene, KeptScene& entry) {
    if (stop.stop_requested()) throw Interrupted(say::evaluation::Interrupted());
    SceneEvaluation measured = MeasureScene(name, scene, entry.truth, options);
    if (const auto& trajectory = measured.keyframes) {
      entry.T_world_scene = trajectory->T_world_scene;
      entry.has_world = true;
    }
    entry.scene = std::move(scene);
    entry.scene.mesh = {};  // nine scenes stay in memory: keep only what pairs need
    return measured;
  };
  for (const std::string& name : suite.scenes)
    evaluation.scenes.push_back(measure(name, options.get_scene(name), kept[name]));
  if (options.get_current) {
    for (const auto& [reference, current] : suite.pairs) {
      if (kept_currents.contains(current)) continue;
      KeptScene& entry = kept_currents[current];
      entry.truth = kept.at(current).truth;
      (void)measure(current, options.get_current(current), entry);
    }
  }
  const std::map<std::string, KeptScene>& currents = options.get_current ? kept_currents : kept;
  for (const auto& [reference, current] : suite.pairs) {
    if (stop.stop_requested()) throw Interrupted(say::evaluation::Interrupted());
    if (progress)
      progress(say::progress::Comparing(), static_cast<double>(evaluation.pairs.size()) /
                                               static_cast<double>(suite.pairs.size()));
    const Comparison comparison =
        Compare(kept.at(reference).scene, currents.at(current).scene, options.compare);
    if (options.store) options.store(reference, current, kept.at(reference).scene, comparison);
    evaluation.pairs.push_back(MeasurePair(reference, current, kept.at(reference),
                                           currents.at(current), comparison, options));
  }
  return evaluation;
}

}  // namespace plumb
