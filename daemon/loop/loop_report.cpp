// SPDX-License-Identifier: Apache-2.0
#include "daemon/loop/loop_report.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace plumb {
namespace {

using Json = nlohmann::json;

double Ms(std::chrono::nanoseconds time) {
  return std::round(std::chrono::duration<double, std::micro>(time).count()) / 1000.0;
}

Json TurnJson(const std::optional<LoopTurn>& turn) {
  if (!turn) return nullptr;
  return {{"what", turn->what},
          {"ms", Ms(turn->wall)},
          {"cpu_ms", Ms(turn->cpu)},
          {"queued_ms", Ms(turn->queued)},
          {"blocked_ms", Ms(turn->blocked)}};
}

}  // namespace

Json LoopJson(const LoopMeter& meter) {
  if (meter.all().count == 0) return nullptr;
  Json slow = Json::object();
  for (const auto& [what, turns] : meter.slow_turns()) {
    slow[what] = {{"times", turns.times}, {"of", turns.of}};
  }
  return {{"turns", meter.all().count},
          {"over_10_ms", meter.all().over_limit},
          {"cpu_over_10_ms", meter.all().cpu_over_limit},
          {"slow", slow},
          {"longest", TurnJson(meter.longest())},
          {"longest_cpu", TurnJson(meter.longest_cpu())}};
}

std::string LoopTable(const LoopMeter& meter) {
  std::vector<std::pair<std::string, LoopFigures>> rows(meter.by_name().begin(),
                                                        meter.by_name().end());
  std::stable_sort(rows.begin(), rows.end(), [](const auto& a, const auto& b) {
    return a.second.longest > b.second.longest;
  });
  std::string text = fmt::format("{:>8} {:>10} {:>11} {:>8} {:>8}\n", "times", "longest ms",
                                 "longest cpu", "> 10 ms", "cpu >");
  for (const auto& [name, figures] : rows) {
    text += fmt::format("{:>8} {:>10.2f} {:>11.2f} {:>8} {:>8}  {}\n", figures.count,
                        Ms(figures.longest), Ms(figures.longest_cpu), figures.over_limit,
                        figures.cpu_over_limit, name);
  }
  return text;
}

std::string SlowTurnText(const LoopTurn& turn, std::int64_t unsaid) {
  const std::string more =
      unsaid > 0 ? fmt::format("; {} more since the last such line", unsaid) : "";
  return fmt::format(
      "the event loop was held up for {:.0f} ms by {}: {:.0f} ms of work, {:.0f} ms waiting for a "
      "processor, {:.0f} ms blocked (disk, lock){}",
      Ms(turn.wall), turn.what, Ms(turn.cpu), Ms(turn.queued), Ms(turn.blocked), more);
}

}  // namespace plumb
