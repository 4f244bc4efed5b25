// SPDX-License-Identifier: Apache-2.0
// Live monitoring against the truth that a simulator writes beside a recording of a sensor at rest.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "algo/base/pose.hpp"
#include "algo/monitoring/monitor.hpp"
#include "algo/verdict/gates.hpp"
#include "daemon/evaluation/accuracy.hpp"
#include "daemon/evaluation/number_errors.hpp"

namespace plumb {

/// The body at one frame.
struct LiveTruthLine {
  double time_s = 0.0;
  Pose T_world_body = Pose::Identity();
  double belly_m = 0.0;  ///< Height of its highest point above that at the end of expiration.
  bool sensor_moved = false;
};

/// A motion of the body away from its place at the zero, at once.
struct LiveStep {
  double time_s = 0.0;
  std::string size;  ///< As shown: "5 mm".
};

/// live.json and live.csv.
struct LiveTruth {
  std::string scene, reference;          ///< Names of the suite's scenes.
  Pose T_world_body = Pose::Identity();  ///< At the zero.
  Pose T_world_reference_marker = Pose::Identity();
  std::vector<LiveTruthLine> lines;  ///< Increasing in time.
  std::vector<LiveStep> steps = {};  ///< Likewise; only of recordings without files.
};

/// @throws DataError naming the file and what is wrong with it.
[[nodiscard]] LiveTruth ReadLiveTruth(const std::filesystem::path& folder);

/// Of two sensors over the same body: lines of both, and the sensors have moved where both have.
[[nodiscard]] LiveTruth TruthTogether(const LiveTruth& a, const LiveTruth& b);

/// Figures of one recording.
struct LiveFigures {
  std::size_t frames = 0;
  std::map<MonitorState, std::size_t> states;
  ErrorSummary shift_mm, turn_deg;  ///< Since zero, at the centroid, over frames with numbers.
  IntervalCount intervals;          ///< Of the six numbers since zero.
  ErrorSummary against_shift_mm, against_turn_deg;  ///< Against the reference, likewise.
  std::optional<double> breathing_r;                ///< Correlation with the truth,
  double breathing_rms_mm = 0.0;                    ///< and the error.
  std::size_t in = 0, out = 0;                      ///< Frames `in`; with the truth out.
  std::size_t false_in = 0;                         ///< Frames `in` while the truth is out.
  std::size_t false_moved = 0;  ///< Frames `moved_sensor` while it has not moved.
  /// Times `in` was left while the truth was within 60 % of every tolerance.
  std::size_t needless_holds = 0;
  std::size_t blind_holds = 0;       ///< Those of them at which the body was not seen.
  std::vector<double> hold_after_s;  ///< From the truth's going out to hold.
  /// From a step until hold, by its size, where the advice was `in` before; and how many led to
  /// none.
  std::map<std::string, std::vector<double>> hold_after_step_s;
  std::map<std::string, std::size_t> not_held;
  double minute_mm = 0.0;               ///< Largest mean error of shift over a whole minute: drift.
  std::optional<double> moved_after_s;  ///< From a push of the sensor until it was found.
  std::vector<double> cpu_s;            ///< Of each frame after the zero.
};

/// The advice must be that of the motion since zero.
/// @param centroid_m, reference_centroid_m  At which the numbers are, as the monitor states them.
/// @param reference  Placement of the body in the reference scene: T_world_body.
[[nodiscard]] LiveFigures FiguresOf(std::span<const MonitorLine> lines, const LiveTruth& truth,
                                    const Eigen::Vector3d& centroid_m,
                                    const std::optional<Eigen::Vector3d>& reference_centroid_m,
                                    const Pose& reference, const AcceptanceLimits& limits);

/// By name of the recording.
using LiveEvaluation = std::map<std::string, LiveFigures>;
[[nodiscard]] std::string LiveTable(const LiveEvaluation& evaluation);
/// {"format": 1, "recordings": {NAME: {...}}}
[[nodiscard]] std::string LiveJson(const LiveEvaluation& evaluation);

}  // namespace plumb
