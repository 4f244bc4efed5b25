// SPDX-License-Identifier: Apache-2.0
#include "daemon/evaluation/live_endless.hpp"

#include <time.h>

#include <algorithm>
#include <map>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/monitoring/monitor.hpp"
#include "daemon/evaluation/live_accuracy.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/simulator/suites/suite_plan.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

double CpuOfEndless_s() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

LiveFigures JudgePart(const EndlessOptions& options, unsigned seed, const std::stop_token& stop,
                      const std::function<void(double)>& progress) {
  SimulateOptions simulate = simulated::EndlessSuite(options.simulate);
  simulate.seed = seed;
  const simulated::SuitePlan plan = simulated::PlanSuite(simulate);
  const Scene scene = RunScan(*simulated::MakeSource(plan, plan.num_sweeps - 1), {}, stop);
  simulated::EndlessLive source(plan, options.kind, options.part_s, options.rate_hz);
  MonitorOptions monitoring;
  monitoring.limits = options.limits;
  Monitor monitor(scene, source.info(), monitoring);
  LiveTruth truth;
  truth.T_world_body = source.T_world_body();
  truth.T_world_reference_marker = plan.room.boards.front().T_world_marker;
  for (const simulated::EndlessStep& step : source.steps())
    truth.steps.push_back({step.time_s, step.size});
  std::vector<MonitorLine> lines;
  std::vector<double> cpu_s;
  const auto total = static_cast<double>(source.info().num_frames.value_or(1));
  while (const std::optional<Frame> frame = source.Next()) {
    if (stop.stop_requested()) throw Interrupted(say::cli::NothingWritten());
    const double begun_s = CpuOfEndless_s();
    lines.push_back(monitor.Add(*frame).value());
    if (lines.back().state >= MonitorState::kMonitoring)
      cpu_s.push_back(CpuOfEndless_s() - begun_s);
    truth.lines.push_back({.time_s = source.truth().time_s,
                           .T_world_body = source.truth().T_world_body,
                           .belly_m = source.truth().belly_m});
    progress(static_cast<double>(lines.size()) / total);
  }
  LiveFigures figures = FiguresOf(lines, truth, monitor.scene().centroid_m, std::nullopt,
                                  truth.T_world_body, options.limits);
  figures.cpu_s = cpu_s;
  return figures;
}

std::string StemOf(const EndlessOptions& options) {
  return fmt::format("{}-{}-", Name(options.kind), Name(options.simulate.sensor));
}

// Of all parts together; medians are those of the parts' medians.
struct Together {
  std::size_t parts = 0, frames = 0, in = 0, out = 0, false_in = 0, false_moved = 0, holds = 0,
              blind_holds = 0, blind = 0, inside = 0, count = 0;
  double seconds = 0, minute_mm = 0;
  std::vector<double> median_mm, p95_mm, median_deg, p95_deg, r, rms_mm, cpu_ms;
  std::map<std::string, std::vector<double>> hold_s;
  std::map<std::string, std::size_t> not_held;

  void Add(const nlohmann::json& part, double rate_hz) {
    ++parts;
    frames += part.at("frames").get<std::size_t>();
    seconds = static_cast<double>(frames) / rate_hz;
    in += part.at("in").get<std::size_t>();
    out += part.at("out").get<std::size_t>();
    false_in += part.at("false_in").get<std::size_t>();
    false_moved += part.at("false_moved").get<std::size_t>();
    holds += part.at("needless_holds").get<std::size_t>();
    blind_holds += part.at("blind_holds").get<std::size_t>();
    blind += part.at("states").value("blind", std::size_t{0});
    inside += part.at("intervals").at("inside").get<std::size_t>();
    count += part.at("intervals").at("count").get<std::size_t>();
    minute_mm = std::max(minute_mm, part.at("minute_mm").get<double>());
    median_mm.push_back(part.at("shift_mm").at("median").get<double>());
    p95_mm.push_back(part.at("shift_mm").at("p95").get<double>());
    median_deg.push_back(part.at("turn_deg").at("median").get<double>());
    p95_deg.push_back(part.at("turn_deg").at("p95").get<double>());
    cpu_ms.push_back(part.at("cpu_ms").at("median").get<double>());
    if (part.at("breathing_r").is_number()) {
      r.push_back(part.at("breathing_r").get<double>());
      rms_mm.push_back(part.at("breathing_rms_mm").get<double>());
    }
    for (const auto& [size, times] : part.at("hold_after_step_s").items())
      for (const auto& one : times) hold_s[size].push_back(one.get<double>());
    for (const auto& [size, missed] : part.at("steps_not_held").items())
      not_held[size] += missed.get<std::size_t>();
  }

  [[nodiscard]] std::string Text() const {
    const auto range = [](std::vector<double> values, int digits) {
      if (values.empty()) return std::string("-");
      std::ranges::sort(values);
      return fmt::format("{:.{}f} ({:.{}f} to {:.{}f})", values[values.size() / 2], digits,
                         values.front(), digits, values.back(), digits);
    };
    std::string text = fmt::format(
        "{} parts, {} frames, {:.2f} h; {} in, {} with the body out, {} blind\n"
        "in while out {}; false moved_sensor frames {}; needless holds {} ({:.1f} an hour), {} of "
        "them blind\n"
        "since zero, median of the parts (least to most): mm median {}, 95th {}; deg median {}, "
        "95th {}\n"
        "intervals that hold {:.1f} %; breathing r {}, RMS mm {}; CPU ms {}\n"
        "largest mean error of a minute {:.2f} mm\n",
        parts, frames, seconds / 3600, in, out, blind, false_in, false_moved, holds,
        seconds > 0 ? 3600.0 * static_cast<double>(holds) / seconds : 0.0, blind_holds,
        range(median_mm, 2), range(p95_mm, 2), range(median_deg, 3), range(p95_deg, 3),
        count > 0 ? 100.0 * static_cast<double>(inside) / static_cast<double>(count) : 0.0,
        range(r, 4), range(rms_mm, 2), range(cpu_ms, 1), minute_mm);
    for (const auto& [size, times] : hold_s) {
      const ErrorSummary hold = Summarise(times);
      const auto missed = not_held.find(size);
      text += fmt::format(
          "a step of {}: hold after {:.2f} s (median), {:.2f} s (95th), of {}; {} "
          "without a hold\n",
          size, hold.median, hold.p95, times.size(), missed == not_held.end() ? 0 : missed->second);
    }
    return text;
  }
};

}  // namespace

std::string RunEndless(const EndlessOptions& options, const std::stop_token& stop,
                       const std::function<void(int part, double fraction)>& progress) {
  Together together;
  for (int k = 0; k < options.parts; ++k) {
    const unsigned seed = options.simulate.seed + static_cast<unsigned>(k);
    const std::string name = StemOf(options) + std::to_string(seed);
    const fs::path file = options.out / (name + ".json");
    if (!fs::exists(file)) {
      const LiveFigures figures =
          JudgePart(options, seed, stop, [&](double fraction) { progress(k + 1, fraction); });
      const std::string text = LiveJson({{name, figures}});
      WriteFileAtomically(file, [&](const fs::path& partial) { WriteWholeFile(partial, text); });
    }
    constexpr std::size_t kMostBytes = std::size_t{16} << 20;
    together.Add(ParseBoundedJson(ReadTextFile(file, kMostBytes)).at("recordings").at(name),
                 options.rate_hz);
  }
  return together.Text();
}

}  // namespace plumb
