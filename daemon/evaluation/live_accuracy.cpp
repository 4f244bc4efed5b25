// SPDX-License-Identifier: Apache-2.0
#include "daemon/evaluation/live_accuracy.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "words/evaluation.hpp"

namespace plumb {
namespace {

using OrderedJson = nlohmann::ordered_json;

std::string WholeTruthFile(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in)
    throw DataError(say::evaluation::TruthFile(file.string(), say::evaluation::TruthMissing()));
  return text.str();
}

Pose PoseOfRows(const nlohmann::json& rows) {
  Pose T;
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c)
      T.matrix()(r, c) =
          rows.at(static_cast<std::size_t>(r)).at(static_cast<std::size_t>(c)).get<double>();
  }
  return Orthonormalised(T);
}

bool IsOut(const Vector6d& numbers, const AcceptanceLimits& limits, double share) {
  for (Eigen::Index i = 0; i < 6; ++i) {
    const double tolerance = i < 3 ? limits.shift_tolerance_m : limits.rotation_tolerance_rad;
    if (std::abs(numbers[i]) > share * tolerance) return true;
  }
  return false;
}

const LiveTruthLine& At(const LiveTruth& truth, double time_s) {
  const auto after =
      std::lower_bound(truth.lines.begin(), truth.lines.end(), time_s,
                       [](const LiveTruthLine& line, double t) { return line.time_s < t; });
  if (after == truth.lines.begin()) return *after;
  const auto before = std::prev(after);
  if (after == truth.lines.end() || time_s - before->time_s < after->time_s - time_s)
    return *before;
  return *after;
}

struct BreathingPairs {
  std::vector<double> measured_m, true_m;
  void Into(LiveFigures& figures) const {
    const auto count = static_cast<double>(measured_m.size());
    if (count < 3) return;
    double a = 0, b = 0, aa = 0, bb = 0, ab = 0, off = 0;
    for (std::size_t i = 0; i < measured_m.size(); ++i) {
      a += measured_m[i] / count;
      b += true_m[i] / count;
      off += std::pow(measured_m[i] - true_m[i], 2) / count;
    }
    for (std::size_t i = 0; i < measured_m.size(); ++i) {
      aa += (measured_m[i] - a) * (measured_m[i] - a);
      bb += (true_m[i] - b) * (true_m[i] - b);
      ab += (measured_m[i] - a) * (true_m[i] - b);
    }
    if (aa > 0 && bb > 0) figures.breathing_r = ab / std::sqrt(aa * bb);
    figures.breathing_rms_mm = std::sqrt(off) / kMillimetre;
  }
};

// Means of the errors over whole minutes.
class MinuteMeans {
 public:
  void Add(double time_s, const Eigen::Vector3d& error_m) {
    if (!begin_s_) begin_s_ = time_s;
    constexpr double kMinute_s = 60.0;
    if (time_s - *begin_s_ >= kMinute_s) {
      largest_m_ = std::max(largest_m_, (sum_m_ / static_cast<double>(count_)).norm());
      begin_s_ = time_s;
      sum_m_.setZero();
      count_ = 0;
    }
    sum_m_ += error_m;
    ++count_;
  }
  [[nodiscard]] double largest_m() const { return largest_m_; }

 private:
  std::optional<double> begin_s_;
  Eigen::Vector3d sum_m_ = Eigen::Vector3d::Zero();
  std::size_t count_ = 0;
  double largest_m_ = 0.0;
};

// Advice against the truth, from frame to frame.
class AdviceCheck {
 public:
  AdviceCheck(const AcceptanceLimits& limits, const std::vector<LiveStep>& steps,
              LiveFigures& figures)
      : limits_(limits), steps_(steps), figures_(figures) {}
  void Add(const MonitorLine& line, const Vector6d& truth, bool sensor_moved) {
    const bool in = line.advice == LiveAdvice::kIn;
    const bool out = IsOut(truth, limits_, 1.0);
    if (in) ++figures_.in;
    if (out) ++figures_.out;
    if (in && out) ++figures_.false_in;
    AddStep(line.time_s, in);
    if (out && !was_out_ && was_in_) went_out_s_ = line.time_s;
    if (went_out_s_ && !in) {
      figures_.hold_after_s.push_back(line.time_s - *went_out_s_);
      went_out_s_.reset();
    }
    constexpr double kWellInside = 0.6;
    if (was_in_ && !in && !sensor_moved && !IsOut(truth, limits_, kWellInside)) {
      ++figures_.needless_holds;
      if (line.state == MonitorState::kBlind) ++figures_.blind_holds;
    }
    was_out_ = out;
    was_in_ = in;
  }

 private:
  void AddStep(double time_s, bool in) {
    constexpr double kMost_s = 2.0;  // A later hold has another reason.
    if (stepped_ != nullptr && time_s - stepped_->time_s > kMost_s) {
      ++figures_.not_held[stepped_->size];
      stepped_ = nullptr;
    }
    if (stepped_ != nullptr && !in) {
      figures_.hold_after_step_s[stepped_->size].push_back(time_s - stepped_->time_s);
      stepped_ = nullptr;
    }
    for (; next_step_ < steps_.size() && steps_[next_step_].time_s <= time_s; ++next_step_) {
      if (stepped_ != nullptr) ++figures_.not_held[stepped_->size];
      stepped_ = was_in_ ? &steps_[next_step_] : nullptr;
      if (stepped_ == nullptr || in) continue;
      figures_.hold_after_step_s[stepped_->size].push_back(time_s - stepped_->time_s);
      stepped_ = nullptr;
    }
  }

  const AcceptanceLimits& limits_;
  const std::vector<LiveStep>& steps_;
  std::size_t next_step_ = 0;
  const LiveStep* stepped_ = nullptr;  ///< The last one, until hold.
  LiveFigures& figures_;
  bool was_in_ = false, was_out_ = false;
  std::optional<double> went_out_s_;
};

void AddErrors(const LiveNumbers& numbers, const Vector6d& truth, std::vector<double>& shift_mm,
               std::vector<double>& turn_deg) {
  const Vector6d error = numbers.value - truth;
  shift_mm.push_back(error.head<3>().norm() / kMillimetre);
  turn_deg.push_back(error.tail<3>().norm() / kDegree);
}

}  // namespace

LiveTruth ReadLiveTruth(const std::filesystem::path& folder) {
  LiveTruth truth;
  const std::filesystem::path about = folder / "live.json", file = folder / "live.csv";
  try {
    const nlohmann::json json = ParseBoundedJson(WholeTruthFile(about));
    truth.scene = json.at("scene").get<std::string>();
    truth.reference = json.at("reference").get<std::string>();
    truth.T_world_body = PoseOfRows(json.at("T_world_body"));
    truth.T_world_reference_marker = PoseOfRows(json.at("T_world_reference_marker"));
  } catch (const std::exception& error) {
    throw DataError(say::evaluation::TruthFile(about.string(), MessageOf(error)));
  }
  std::istringstream in(WholeTruthFile(file));
  std::string text;
  for (int number = 1; std::getline(in, text); ++number) {
    if (number == 1) continue;  // names of the columns
    std::replace(text.begin(), text.end(), ',', ' ');
    std::istringstream fields(text);
    LiveTruthLine line;
    double x = 0, y = 0, z = 0, qx = 0, qy = 0, qz = 0, qw = 0, belly_mm = 0, chest_mm = 0;
    int moved = 0;
    if (!(fields >> line.time_s >> x >> y >> z >> qx >> qy >> qz >> qw >> belly_mm >> chest_mm >>
          moved))
      throw DataError(say::evaluation::TruthFile(file.string(), say::evaluation::PoseLine(number)));
    line.T_world_body.linear() = Eigen::Quaterniond(qw, qx, qy, qz).normalized().toRotationMatrix();
    line.T_world_body.translation() = Eigen::Vector3d(x, y, z);
    line.belly_m = belly_mm * kMillimetre;
    line.sensor_moved = moved != 0;
    truth.lines.push_back(line);
  }
  if (truth.lines.empty())
    throw DataError(say::evaluation::TruthFile(file.string(), say::evaluation::TruthEndsEarly()));
  return truth;
}

LiveTruth TruthTogether(const LiveTruth& a, const LiveTruth& b) {
  LiveTruth together = a;
  together.lines.clear();
  const auto add = [&](const LiveTruth& from, const LiveTruth& other) {
    for (LiveTruthLine line : from.lines) {
      line.sensor_moved = line.sensor_moved && At(other, line.time_s).sensor_moved;
      together.lines.push_back(line);
    }
  };
  add(a, b);
  add(b, a);
  std::ranges::sort(together.lines, {}, &LiveTruthLine::time_s);
  return together;
}

LiveFigures FiguresOf(std::span<const MonitorLine> lines, const LiveTruth& truth,
                      const Eigen::Vector3d& centroid_m,
                      const std::optional<Eigen::Vector3d>& reference_centroid_m,
                      const Pose& reference, const AcceptanceLimits& limits) {
  LiveFigures figures;
  figures.frames = lines.size();
  std::vector<double> shift_mm, turn_deg, against_mm, against_deg;
  BreathingPairs breathing;
  AdviceCheck advice(limits, truth.steps, figures);
  MinuteMeans minutes;
  std::optional<double> pushed_s;
  const Pose T_marker_world = truth.T_world_reference_marker.inverse();
  const auto motion = [&](const LiveTruthLine& now, const Pose& from, const Eigen::Vector3d& at) {
    const Pose T = T_marker_world * now.T_world_body * from.inverse() * T_marker_world.inverse();
    return NumbersOfMotion(T, Matrix6d::Zero(), at, std::nullopt).value;
  };
  for (const MonitorLine& line : lines) {
    ++figures.states[line.state];
    const LiveTruthLine& now = At(truth, line.time_s);
    const Vector6d true_numbers = motion(now, truth.T_world_body, centroid_m);
    if (now.sensor_moved && !pushed_s) pushed_s = line.time_s;
    if (line.state == MonitorState::kMovedSensor) {
      if (!now.sensor_moved)
        ++figures.false_moved;
      else if (!figures.moved_after_s)
        figures.moved_after_s = line.time_s - *pushed_s;
    }
    advice.Add(line, true_numbers, now.sensor_moved);
    // The numbers are wrong from a push of the sensor until the monitor notices it. Only the advice
    // is judged then.
    if (now.sensor_moved) continue;
    if (line.since_zero) {
      AddErrors(*line.since_zero, true_numbers, shift_mm, turn_deg);
      minutes.Add(line.time_s, (line.since_zero->value - true_numbers).head<3>());
      for (Eigen::Index i = 0; i < 6; ++i) {
        ++figures.intervals.count;
        if (std::abs(line.since_zero->value[i] - true_numbers[i]) <= line.since_zero->u95[i])
          ++figures.intervals.inside;
      }
    }
    if (line.against_reference && reference_centroid_m)
      AddErrors(*line.against_reference, motion(now, reference, *reference_centroid_m), against_mm,
                against_deg);
    if (line.breathing_m) {
      breathing.measured_m.push_back(*line.breathing_m);
      breathing.true_m.push_back(now.belly_m);
    }
  }
  figures.shift_mm = Summarise(shift_mm);
  figures.turn_deg = Summarise(turn_deg);
  figures.against_shift_mm = Summarise(against_mm);
  figures.against_turn_deg = Summarise(against_deg);
  figures.minute_mm = minutes.largest_m() / kMillimetre;
  breathing.Into(figures);
  return figures;
}

std::string LiveTable(const LiveEvaluation& evaluation) {
  std::string text = fmt::format(
      "{:<14} {:>6} {:>6} {:>6} | {:>20} | {:>20} | {:>6} | {:>11} | {:>8} {:>6} {:>6} | {:>9} "
      "{:>6}\n",
      "monitoring", "frames", "blind", "moved", "mm med / 95 / max", "deg med / 95 / max", "in 95",
      "breath r", "false in", "f.mov.", "holds", "hold s", "CPU ms");
  for (const auto& [name, figures] : evaluation) {
    const LiveFigures& f = figures;  // clang 14 lets no lambda capture a structured binding
    const auto state = [&f](MonitorState wanted) {
      const auto found = f.states.find(wanted);
      return found == f.states.end() ? std::size_t{0} : found->second;
    };
    const auto triple = [](const ErrorSummary& e) {
      return fmt::format("{:.2f} / {:.2f} / {:.2f}", e.median, e.p95, e.max);
    };
    const ErrorSummary cpu = Summarise(f.cpu_s), hold = Summarise(f.hold_after_s);
    text += fmt::format(
        "{:<14} {:>6} {:>6} {:>6} | {:>20} | {:>20} | {:>5.1f}% | {:>11} | {:>8} {:>6} {:>6} | "
        "{:>9} {:>6.1f}\n",
        name, f.frames, state(MonitorState::kBlind), state(MonitorState::kMovedSensor),
        triple(f.shift_mm), triple(f.turn_deg), 100 * f.intervals.Fraction(),
        f.breathing_r ? fmt::format("{:.4f} {:.2f}", *f.breathing_r, f.breathing_rms_mm) : "-",
        f.false_in, f.false_moved, f.needless_holds,
        f.hold_after_s.empty() ? "-" : fmt::format("{:.2f}/{:.2f}", hold.median, hold.max),
        cpu.median * 1e3);
    if (f.against_shift_mm.count > 0)
      text += fmt::format("{:<14} against the reference: mm {}, deg {}\n", "",
                          triple(f.against_shift_mm), triple(f.against_turn_deg));
    if (f.moved_after_s)
      text += fmt::format("{:<14} the push was found after {:.2f} s\n", "", *f.moved_after_s);
  }
  return text;
}

std::string LiveJson(const LiveEvaluation& evaluation) {
  OrderedJson recordings = OrderedJson::object();
  for (const auto& [name, f] : evaluation) {
    std::vector<double> cpu_ms = f.cpu_s;
    for (double& value : cpu_ms) value *= 1e3;
    const auto summary = [](const ErrorSummary& e) {
      return OrderedJson{{"count", e.count}, {"median", e.median}, {"p95", e.p95}, {"max", e.max}};
    };
    OrderedJson states;
    for (const auto& [state, count] : f.states) states[std::string(Name(state))] = count;
    recordings[name] = {
        {"frames", f.frames},
        {"states", states},
        {"shift_mm", summary(f.shift_mm)},
        {"turn_deg", summary(f.turn_deg)},
        {"intervals", {{"count", f.intervals.count}, {"inside", f.intervals.inside}}},
        {"against_shift_mm", summary(f.against_shift_mm)},
        {"against_turn_deg", summary(f.against_turn_deg)},
        {"breathing_r", f.breathing_r ? OrderedJson(*f.breathing_r) : OrderedJson()},
        {"breathing_rms_mm", f.breathing_rms_mm},
        {"in", f.in},
        {"out", f.out},
        {"false_in", f.false_in},
        {"false_moved", f.false_moved},
        {"needless_holds", f.needless_holds},
        {"blind_holds", f.blind_holds},
        {"hold_after_s", f.hold_after_s},
        {"hold_after_step_s", f.hold_after_step_s},
        {"steps_not_held", f.not_held},
        {"minute_mm", f.minute_mm},
        {"moved_after_s", f.moved_after_s ? OrderedJson(*f.moved_after_s) : OrderedJson()},
        {"cpu_ms", summary(Summarise(cpu_ms))}};
  }
  return OrderedJson{{"format", 1}, {"recordings", recordings}}.dump(1) + "\n";
}

}  // namespace plumb
