// The accuracy of the whole chain on a suite of recordings with truth.
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

/// Where the recordings and truths of a suite are, and which scenes are compared.
struct Suite {
  std::string name;
  std::vector<std::string> scenes;
  std::vector<std::pair<std::string, std::string>> pairs;  ///< (reference, current)
  std::map<std::string, std::filesystem::path> recordings;
  std::map<std::string, std::filesystem::path> truths;
};

/// Reads `suite.json`; where it is missing, every folder of `truth/` is a scene ("reference" first)
/// and all ordered pairs count. Recordings lie in `recordings/NAME`, `recordings/NAME.oni` or
/// `NAME`.
/// @throws DataError if the folder is no suite or a recording or truth is missing.
[[nodiscard]] Suite OpenSuite(const std::filesystem::path& folder);

/// What one scene came out as.
struct SceneEvaluation {
  std::string name;
  std::int64_t frames_total = 0, frames_tracked = 0;
  std::size_t num_keyframes = 0, num_markers = 0;
  std::optional<TrajectoryError> keyframes, trajectory;
  std::optional<double> marker_rms_mm;  ///< Marker corners after their own best rigid fit to the
                                        ///< true ones; none matched: nothing.
  std::optional<double> marker_scale_permille;  ///< By how much the marker map is too large.
  std::optional<HeightError>
      heights;  ///< Against the true surface in the true reference marker's frame.
  std::optional<ShapeError> shape;
  std::map<std::string, double> calibration, timings_s;
};

/// What one ordered pair came out as. Without a motion the pair counts as "no answer", never as an
/// error of 0.
struct PairEvaluation {
  std::string reference, current;
  Verdict verdict = Verdict::kNoAnswer;
  std::vector<std::string> reasons;
  std::optional<MotionError> motion;
  TrueNumbers truth = {};  ///< At the isocentre of the correction, else at the true centroid.
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
  AcceptanceLimits limits;  ///< Under which the verdicts were given.
  std::vector<SceneEvaluation> scenes;
  std::vector<PairEvaluation> pairs;

  [[nodiscard]] MotionStatistics Total() const;
  [[nodiscard]] MotionStatistics OfReference(const std::string& reference) const;
};

struct EvaluateOptions {
  CompareOptions compare;
  double min_frames_seen =
      3;  ///< A part of the body counts as visible if at least this many frames measured it.
  /// Makes (or finds) the scene of a name; required.
  std::function<Scene(const std::string& name)> get_scene = {};
  /// If set, called with every comparison, for storing.
  std::function<void(const std::string& reference, const std::string& current,
                     const Scene& reference_scene, const Comparison&)>
      store = {};
};

/// Reconstructs every scene, compares every pair, and measures both against the truth.
/// @throws DataError from truths, recordings and comparisons; Interrupted on a stop request.
[[nodiscard]] Evaluation EvaluateSuite(
    const Suite& suite, const EvaluateOptions& options, const std::stop_token& stop = {},
    const std::function<void(const std::string& what, double fraction)>& progress = {});

}  // namespace plumb
