// SPDX-License-Identifier: Apache-2.0
// The accuracy of the complete method on a suite of recordings with truth.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "algo/comparison/comparison.hpp"
#include "algo/types/scene.hpp"
#include "daemon/evaluation/accuracy.hpp"
#include "daemon/evaluation/number_errors.hpp"

namespace plumb {

/// Locations of the recordings and truths of a suite, and the scenes to compare.
struct Suite {
  std::string name;
  std::vector<std::string> scenes;
  std::vector<std::pair<std::string, std::string>> pairs;  ///< (reference, current)
  std::map<std::string, std::filesystem::path> recordings;
  std::map<std::string, std::filesystem::path> truths;
  /// Recordings of a sensor at rest; theirs are among `recordings` and `truths`, too.
  std::vector<std::string> live;
  /// Names of sensors' recordings of the same time, which are evaluated together, too.
  std::map<std::string, std::vector<std::string>> live_together;
};

/// Reads `suite.json`. Without it, every folder of `truth/` is a scene ("reference" first) and all
/// ordered pairs are used. Recordings are in `recordings/NAME`, `recordings/NAME.oni` or `NAME`.
/// @throws DataError if the folder is not a suite or a recording or truth is missing.
[[nodiscard]] Suite OpenSuite(const std::filesystem::path& folder);

/// Results for one scene.
struct SceneEvaluation {
  std::string name;
  std::int64_t frames_total = 0, frames_tracked = 0;
  std::size_t num_keyframes = 0, num_markers = 0;
  std::optional<TrajectoryError> keyframes, trajectory;
  /// Marker corners after their own best rigid fit to the true ones; not set if none matched.
  std::optional<double> marker_rms_mm;
  std::optional<double> marker_scale_permille;  ///< Scale error of the marker map.
  IntervalCount marker_intervals;               ///< See CoverageOfMarkers().
  std::optional<HeightError>
      heights;  ///< Against the true surface in the true reference marker's frame.
  std::optional<ShapeError> shape;
  std::optional<double> breathing_mm;  ///< Estimated rise; not set where the sweep cannot tell.
  double true_breathing_mm = 0.0;
  std::map<std::string, double> calibration, timings_s;
};

/// Results for one ordered pair. A pair without a motion counts as "no answer", never as an error
/// of 0.
struct PairEvaluation {
  std::string reference, current;
  Verdict verdict = Verdict::kNoAnswer;
  std::vector<Message> reasons;
  std::optional<MotionError> motion;
  TrueNumbers truth = {};  ///< At the isocentre of the correction, otherwise at the true centroid.
  std::optional<NumberErrors> numbers;
  std::optional<AlignmentError> alignment;
  std::optional<HeightError>
      deviation;  ///< Height deviation against the true one where both bodies are visible.
  std::optional<DeformationError> deformation;
  std::map<std::string, double> timings_s;
};

/// Statistics of a group of pairs.
struct MotionStatistics {
  std::size_t num_pairs = 0, num_without_motion = 0, num_no_answer = 0;
  ErrorSummary rotation_deg, translation_mm;
  IntervalCoverage intervals;
  VerdictCount verdicts;
};

struct Evaluation {
  std::string suite;
  Preset preset = Preset::kBest;
  AcceptanceLimits limits;  ///< Limits for the verdicts.
  std::vector<SceneEvaluation> scenes;
  std::vector<PairEvaluation> pairs;

  [[nodiscard]] MotionStatistics Total() const;
  [[nodiscard]] MotionStatistics OfReference(const std::string& reference) const;
  /// Over all scenes.
  [[nodiscard]] IntervalCount MarkerIntervals() const;
};

struct EvaluateOptions {
  CompareOptions compare;
  double min_frames_seen =
      3;  ///< Frames that must have measured a part of the body for it to count as visible.
  /// Creates (or finds) the scene of a name; required.
  std::function<Scene(const std::string& name)> get_scene = {};
  /// If set, creates the current scenes of the pairs, for example of a part of each sweep.
  std::function<Scene(const std::string& name)> get_current = {};
  /// If set, called with every comparison, to store it.
  std::function<void(const std::string& reference, const std::string& current,
                     const Scene& reference_scene, const Comparison&)>
      store = {};
};

/// Reconstructs every scene, compares every pair, and measures both against the truth.
/// @throws DataError from truths, recordings and comparisons; Interrupted on a stop request.
[[nodiscard]] Evaluation EvaluateSuite(
    const Suite& suite, const EvaluateOptions& options, const std::stop_token& stop = {},
    const std::function<void(const Message& what, double fraction)>& progress = {});

}  // namespace plumb
