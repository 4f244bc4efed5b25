// SPDX-License-Identifier: Apache-2.0
#include "daemon/evaluation/report.hpp"

#include <array>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/message_json.hpp"
#include "algo/base/notice.hpp"

namespace plumb {
namespace {

using nlohmann::ordered_json;

/// One row of the paper's accuracy table (Xtion Pro Live, mannequin, 9 scenes, 72 ordered pairs).
struct PaperRow {
  double rotation_mean_deg, rotation_median_deg, translation_mean_mm, translation_median_mm;
};
constexpr std::array<PaperRow, 9> kPaperRows = {{{1.180, 0.792, 8.716, 8.507},
                                                 {1.655, 1.173, 11.681, 9.168},
                                                 {1.305, 1.073, 10.704, 11.169},
                                                 {1.970, 1.917, 11.950, 10.114},
                                                 {1.255, 0.664, 10.112, 10.222},
                                                 {1.330, 1.005, 10.783, 9.063},
                                                 {1.354, 0.896, 14.250, 13.959},
                                                 {3.008, 3.121, 11.792, 10.534},
                                                 {1.348, 1.103, 13.135, 12.610}}};
constexpr PaperRow kPaperTotal = {1.600, 1.196, 11.458, 10.497};

std::string MotionRow(const std::string& name, const MotionStatistics& s,
                      const std::optional<PaperRow>& paper) {
  std::string row = fmt::format("  {:<12} {:>5}", name, s.num_pairs);
  if (s.translation_mm.count == 0) {
    row += fmt::format(" | {:>27} | {:>27}", "no motion", "no motion");
  } else {
    const ErrorSummary &r = s.rotation_deg, &t = s.translation_mm;
    row += fmt::format(" | {:6.3f} {:6.3f} {:6.3f} {:6.3f}", r.mean, r.median, r.p95, r.max);
    row += fmt::format(" | {:6.2f} {:6.2f} {:6.2f} {:6.2f}", t.mean, t.median, t.p95, t.max);
  }
  if (paper) {
    row += fmt::format(" | {:5.3f} {:6.3f} {:6.3f} {:6.3f}", paper->rotation_mean_deg,
                       paper->rotation_median_deg, paper->translation_mean_mm,
                       paper->translation_median_mm);
  }
  return row + "\n";
}

std::string MotionTable(const Evaluation& evaluation) {
  std::string text = fmt::format(
      "Motion of the body, suite '{}', preset {}: error at the reference body's centroid\n\n",
      evaluation.suite, Name(evaluation.preset));
  text +=
      "                     |      rotation (deg)         |     translation (mm)        | paper "
      "(deg)  |  paper (mm)\n";
  text +=
      "  reference    pairs |   mean median   95th    max |   mean median   95th    max |  mean "
      "median |   mean median\n";
  const std::string rule =
      "  "
      "-------------------+-----------------------------+-----------------------------+------------"
      "---------------\n";
  text += rule;
  std::size_t index = 0;
  for (const SceneEvaluation& scene : evaluation.scenes) {
    const MotionStatistics statistics = evaluation.OfReference(scene.name);
    if (statistics.num_pairs == 0) continue;
    text += MotionRow(scene.name, statistics,
                      index < kPaperRows.size() ? std::optional(kPaperRows[index]) : std::nullopt);
    ++index;
  }
  const MotionStatistics total = evaluation.Total();
  text += rule + MotionRow("total", total, kPaperTotal);
  text += fmt::format("\n  {} pairs; {} without a motion, {} with the verdict no_answer.\n",
                      total.num_pairs, total.num_without_motion, total.num_no_answer);
  constexpr std::size_t kMaxListed = 10;
  std::size_t num_listed = 0;
  for (const PairEvaluation& pair : evaluation.pairs) {
    if (pair.verdict != Verdict::kNoAnswer || num_listed++ >= kMaxListed) continue;
    text += fmt::format("    {} -> {}: {}\n", pair.reference, pair.current,
                        pair.reasons.empty() ? "no reason given" : pair.reasons.front().English());
  }
  if (num_listed > kMaxListed) text += fmt::format("    and {} more\n", num_listed - kMaxListed);
  text +=
      "  The paper's figures are its own nine scenes on a real sensor; its rows stand beside ours "
      "by number, not by pose.\n";
  return text;
}

std::string IntervalTable(const MotionStatistics& total) {
  if (total.intervals.all.count == 0) return "";
  std::string text = fmt::format(
      "\nStated 95 % intervals that hold the truth, over the {} pairs with an answer\n\n ",
      total.intervals.numbers[3].count);
  for (const char* name : kNumberNames) text += fmt::format(" {:>12}", name);
  text += "          all\n ";
  for (const IntervalCount& number : total.intervals.numbers) {
    text += number.count > 0 ? fmt::format(" {:>10.1f} %", 100 * number.Fraction())
                             : fmt::format(" {:>12}", "refused");
  }
  return text + fmt::format(" {:>10.1f} %\n", 100 * total.intervals.all.Fraction());
}

std::string VerdictTable(const MotionStatistics& total, const AcceptanceLimits& limits) {
  const VerdictCount& v = total.verdicts;
  return fmt::format(
      "\nVerdicts at {:g} mm and {:g} deg, {} pairs truly in and {} truly out\n\n"
      "  in_tolerance {}, of which truly out {}\n  unsure       {}\n"
      "  move         {}, of which truly in {}\n  no_answer    {}\n"
      "  in by {:g} mm and {:g} deg or more: {}, of which called in_tolerance {}\n",
      ToleranceOf(limits, 0), ToleranceOf(limits, 3), v.truly_in, v.truly_out, v.in_tolerance,
      v.false_in_tolerance, v.unsure, v.move, v.false_move, v.no_answer, kWellInShift_mm,
      kWellInRotation_deg, v.well_in, v.found_well_in);
}

double Timing(const std::map<std::string, double>& timings_s, const char* key) {
  const auto found = timings_s.find(key);
  return found == timings_s.end() ? 0.0 : found->second;
}

std::string SceneTable(const Evaluation& evaluation) {
  std::string text = "\nScenes against the truth\n\n";
  text +=
      "               frames      key- |  ATE RMSE (mm)  rot. drift | markers      | heights (mm)  "
      "                  | after rigid fit "
      "(mm, permille)\n";
  text +=
      "  scene       tracked    frames |   keys    all  (deg) (mm)  | rms mm scale | bias  |e|50  "
      "RMSE  95th compl. | shift  rot   scale "
      "|e|50   95th | after sweep (s)\n";
  for (const SceneEvaluation& s : evaluation.scenes) {
    text += fmt::format("  {:<10} {:>4}/{:<4} {:>8}   |", s.name, s.frames_tracked, s.frames_total,
                        s.num_keyframes);
    text +=
        fmt::format(" {} {}", s.keyframes ? fmt::format("{:6.2f}", s.keyframes->rmse_mm) : "  none",
                    s.trajectory ? fmt::format("{:6.2f}", s.trajectory->rmse_mm) : "  none");
    text += s.keyframes ? fmt::format(" {:6.3f} {:5.1f} |", s.keyframes->rotation_rmse_deg,
                                      s.keyframes->drift_mm)
                        : "   none  none |";
    text += s.marker_rms_mm && s.marker_scale_permille
                ? fmt::format(" {:6.2f} {:+5.1f} |", *s.marker_rms_mm, *s.marker_scale_permille)
                : "   none  none |";
    if (s.heights) {
      text += fmt::format(" {:+5.2f} {:5.2f} {:5.2f} {:5.2f} {:4.1f}% |", s.heights->bias_mm,
                          s.heights->median_abs_mm, s.heights->rmse_mm, s.heights->p95_mm,
                          100 * s.heights->completeness);
    } else {
      text += "   no height map                |";
    }
    if (s.shape) {
      text += fmt::format(" {:5.2f} {:5.3f} {:+6.2f} {:5.2f} {:6.2f} |", s.shape->shift_mm.norm(),
                          s.shape->rotation_deg.norm(), s.shape->scale_permille,
                          s.shape->left.median_abs_mm, s.shape->left.p95_mm);
    } else {
      text += "                                  |";
    }
    text += fmt::format(" {:6.2f}\n", Timing(s.timings_s, "after_last_frame"));
  }
  if (const IntervalCount corners = evaluation.MarkerIntervals(); corners.count > 0)
    text += fmt::format(
        "\n  {:.1f} % of the coordinates of {} marker corners lie in their stated 95 % "
        "intervals.\n",
        100 * corners.Fraction(), corners.count / 3);
  return text;
}

std::string BreathingTable(const Evaluation& evaluation) {
  std::string text;
  for (const SceneEvaluation& s : evaluation.scenes) {
    if (s.true_breathing_mm == 0.0 && s.breathing_mm.value_or(0.0) == 0.0) continue;
    text +=
        fmt::format("  {:<10} rise {:5.2f} mm, estimated {}\n", s.name, s.true_breathing_mm,
                    s.breathing_mm ? fmt::format("{:5.2f} mm, error {:+5.2f} mm", *s.breathing_mm,
                                                 *s.breathing_mm - s.true_breathing_mm)
                                   : "not at all");
  }
  return text.empty() ? text : "\nBreathing during the sweeps\n\n" + text;
}

std::string AlignmentTable(const Evaluation& evaluation) {
  std::vector<double> corners, body, own_corners, own_body, deviation_median, deviation_p95, rigid,
      deformed;
  for (const PairEvaluation& pair : evaluation.pairs) {
    if (pair.alignment) {
      corners.push_back(pair.alignment->in_true_frames.corners_mm);
      body.push_back(pair.alignment->in_true_frames.body_mm);
      own_corners.push_back(pair.alignment->in_own_frames.corners_mm);
      own_body.push_back(pair.alignment->in_own_frames.body_mm);
    }
    if (pair.deviation) {
      deviation_median.push_back(pair.deviation->median_abs_mm);
      deviation_p95.push_back(pair.deviation->p95_mm);
    }
    if (pair.deformation) {
      rigid.push_back(pair.deformation->rigid_mm.p95);
      deformed.push_back(pair.deformation->deformed_mm.p95);
    }
  }
  std::string text =
      "\nAlignment and deviation over the pairs (mm)                      mean  median    95th     "
      "max\n\n";
  const auto row = [&text](const char* name, std::vector<double> values) {
    const ErrorSummary s = Summarise(std::move(values));
    if (s.count == 0) {
      text += fmt::format("  {:<60} {:>7}\n", name, "none");
      return;
    }
    text += fmt::format("  {:<60} {:7.2f} {:7.2f} {:7.2f} {:7.2f}\n", name, s.mean, s.median, s.p95,
                        s.max);
  };
  row("alignment at marker corners, in the true marker frames", corners);
  row("alignment at the body's centroid, in the true marker frames", body);
  row("alignment at marker corners, each scene where it lies", own_corners);
  row("alignment at the body's centroid, each scene where it lies", own_body);
  row("deviation map against the true one, median |e|", deviation_median);
  row("deviation map against the true one, 95th |e|", deviation_p95);
  row("reference moved rigidly against the true surface, 95th |e|", rigid);
  row("reference moved and deformed, the same samples, 95th |e|", deformed);
  return text;
}

ordered_json ToJson(const ErrorSummary& s) {
  return {{"count", s.count}, {"mean", s.mean}, {"median", s.median},
          {"p95", s.p95},     {"max", s.max},   {"rms", s.rms}};
}

ordered_json ToJson(const IntervalCount& c) {
  return {{"count", c.count},
          {"inside", c.inside},
          {"fraction", c.count > 0 ? ordered_json(c.Fraction()) : ordered_json()}};
}

ordered_json ToJson(const IntervalCoverage& coverage) {
  ordered_json json = ordered_json::object();
  for (std::size_t i = 0; i < coverage.numbers.size(); ++i) {
    json[kNumberNames[i]] = ToJson(coverage.numbers[i]);
  }
  json["all"] = ToJson(coverage.all);
  return json;
}

ordered_json ToJson(const VerdictCount& v) {
  return {{"in_tolerance", v.in_tolerance},
          {"unsure", v.unsure},
          {"move", v.move},
          {"no_answer", v.no_answer},
          {"truly_in", v.truly_in},
          {"truly_out", v.truly_out},
          {"false_in_tolerance", v.false_in_tolerance},
          {"false_move", v.false_move},
          {"found_in", v.found_in},
          {"well_in", v.well_in},
          {"found_well_in", v.found_well_in}};
}

ordered_json ToJson(const MotionStatistics& s) {
  return {{"pairs", s.num_pairs},
          {"without_motion", s.num_without_motion},
          {"no_answer", s.num_no_answer},
          {"rotation_deg", ToJson(s.rotation_deg)},
          {"translation_mm", ToJson(s.translation_mm)},
          {"intervals_95", ToJson(s.intervals)},
          {"verdicts", ToJson(s.verdicts)}};
}

ordered_json ToJson(const std::optional<HeightError>& e) {
  if (!e) return nullptr;
  return {{"cells", e->count},     {"bias_mm", e->bias_mm}, {"median_abs_mm", e->median_abs_mm},
          {"rmse_mm", e->rmse_mm}, {"p95_mm", e->p95_mm},   {"completeness", e->completeness}};
}

ordered_json ToJson(const std::optional<TrajectoryError>& e) {
  if (!e) return nullptr;
  return {{"poses", e->count},
          {"ate_rmse_mm", e->rmse_mm},
          {"median_mm", e->median_mm},
          {"max_mm", e->max_mm},
          {"rotation_rmse_deg", e->rotation_rmse_deg},
          {"drift_mm", e->drift_mm}};
}

ordered_json ToJson(const std::optional<ShapeError>& e) {
  if (!e) return nullptr;
  const auto list = [](const Eigen::Vector3d& v) {
    return ordered_json::array({v.x(), v.y(), v.z()});
  };
  return {{"shift_mm", list(e->shift_mm)},
          {"rotation_deg", list(e->rotation_deg)},
          {"scale_permille", e->scale_permille},
          {"left", ToJson(std::optional(e->left))}};
}

ordered_json ToJson(const AlignmentError::Figures& f) {
  return {{"corners_mm", f.corners_mm}, {"body_mm", f.body_mm}};
}

ordered_json OrNull(const std::optional<double>& value) {
  return value ? ordered_json(*value) : ordered_json();
}

ordered_json ToJson(const SceneEvaluation& s) {
  return {{"frames", {{"total", s.frames_total}, {"tracked", s.frames_tracked}}},
          {"keyframes", s.num_keyframes},
          {"markers", s.num_markers},
          {"trajectory_keyframes", ToJson(s.keyframes)},
          {"trajectory_all", ToJson(s.trajectory)},
          {"marker_rms_mm", OrNull(s.marker_rms_mm)},
          {"marker_scale_permille", OrNull(s.marker_scale_permille)},
          {"marker_intervals_95", ToJson(s.marker_intervals)},
          {"heights", ToJson(s.heights)},
          {"shape", ToJson(s.shape)},
          {"breathing_mm", OrNull(s.breathing_mm)},
          {"true_breathing_mm", s.true_breathing_mm},
          {"calibration", s.calibration},
          {"timings_s", s.timings_s}};
}

ordered_json ToJson(const PairEvaluation& p) {
  ordered_json json = {{"reference", p.reference},
                       {"current", p.current},
                       {"verdict", Name(p.verdict)},
                       {"reasons", EnglishTexts(p.reasons)},
                       {"reason_messages", MessagesJson(p.reasons)}};
  json["rotation_deg"] = p.motion ? ordered_json(p.motion->rotation_deg) : ordered_json();
  json["translation_mm"] = p.motion ? ordered_json(p.motion->translation_mm) : ordered_json();
  json["numbers"] = nullptr;
  if (p.numbers) {
    json["numbers"] = ordered_json::object();
    for (std::size_t i = 0; i < p.numbers->size(); ++i) {
      const std::optional<NumberError>& number = (*p.numbers)[i];
      json["numbers"][kNumberNames[i]] = number ? ordered_json{{"value", number->value},
                                                               {"truth", number->truth},
                                                               {"u95", number->u95},
                                                               {"inside", number->IsInside()}}
                                                : ordered_json();
    }
  }
  json["alignment"] = nullptr;
  if (p.alignment)
    json["alignment"] = {{"in_true_frames", ToJson(p.alignment->in_true_frames)},
                         {"in_own_frames", ToJson(p.alignment->in_own_frames)}};
  json["deviation"] = ToJson(p.deviation);
  json["deformation"] = nullptr;
  if (p.deformation)
    json["deformation"] = {{"rigid_mm", ToJson(p.deformation->rigid_mm)},
                           {"deformed_mm", ToJson(p.deformation->deformed_mm)}};
  json["timings_s"] = p.timings_s;
  return json;
}

ordered_json ToJson(const PaperRow& row) {
  return {{"rotation_deg", {{"mean", row.rotation_mean_deg}, {"median", row.rotation_median_deg}}},
          {"translation_mm",
           {{"mean", row.translation_mean_mm}, {"median", row.translation_median_mm}}}};
}

}  // namespace

std::string EvaluationTable(const Evaluation& evaluation) {
  const MotionStatistics total = evaluation.Total();
  return MotionTable(evaluation) + IntervalTable(total) + VerdictTable(total, evaluation.limits) +
         SceneTable(evaluation) + BreathingTable(evaluation) + AlignmentTable(evaluation) + "\n" +
         std::string(kResearchNotice) + "\n";
}

std::string EvaluationJson(const Evaluation& evaluation) {
  ordered_json json = {
      {"format", 1}, {"suite", evaluation.suite}, {"preset", Name(evaluation.preset)}};
  json["by_reference"] = ordered_json::object();
  json["scenes"] = ordered_json::object();
  for (const SceneEvaluation& scene : evaluation.scenes) {
    const MotionStatistics statistics = evaluation.OfReference(scene.name);
    if (statistics.num_pairs > 0) json["by_reference"][scene.name] = ToJson(statistics);
    json["scenes"][scene.name] = ToJson(scene);
  }
  json["total"] = ToJson(evaluation.Total());
  json["marker_intervals_95"] = ToJson(evaluation.MarkerIntervals());
  json["pairs"] = ordered_json::array();
  for (const PairEvaluation& pair : evaluation.pairs) json["pairs"].push_back(ToJson(pair));
  json["paper"] = {{"by_reference", ordered_json::array()}, {"total", ToJson(kPaperTotal)}};
  for (const PaperRow& row : kPaperRows) json["paper"]["by_reference"].push_back(ToJson(row));
  return json.dump(2) + "\n";
}

}  // namespace plumb
