// SPDX-License-Identifier: Apache-2.0
// What a record of live monitoring says in short.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>

#include "algo/base/units.hpp"
#include "daemon/monitoring_files/monitoring_file.hpp"

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostEventsShown = 300;

struct Times {
  std::map<std::string, double> states, advice;
  double gaps_s = 0.0;
};

/// Each line stands for the time until the next one, but not for a gap.
Times TimesOf(const std::vector<MonitorLine>& lines) {
  Times times;
  for (std::size_t k = 0; k + 1 < lines.size(); ++k) {
    const double until_s = std::max(0.0, lines[k + 1].time_s - lines[k].time_s);
    const double known_s = std::min(until_s, kLongestGap_s);
    times.states[std::string(Name(lines[k].state))] += known_s;
    if (lines[k].state >= MonitorState::kMonitoring)
      times.advice[std::string(Name(lines[k].advice))] += known_s;
    times.gaps_s += until_s - known_s;
  }
  return times;
}

/// From `in` to hold.
int HoldsOf(const std::vector<MonitorLine>& lines) {
  int holds = 0;
  for (std::size_t k = 1; k < lines.size(); ++k) {
    const bool was_in = lines[k - 1].advice == LiveAdvice::kIn;
    const bool gap = lines[k].time_s - lines[k - 1].time_s > kLongestGap_s;
    holds += was_in && (gap || lines[k].advice != LiveAdvice::kIn) ? 1 : 0;
  }
  return holds;
}

/// Over the time in which there were such numbers: least, most and last.
Json MotionOf(const std::vector<MonitorLine>& lines,
              std::optional<LiveNumbers> MonitorLine::*numbers) {
  constexpr std::array<const char*, 6> kKeys = {"lateral_mm", "longitudinal_mm", "vertical_mm",
                                                "pitch_deg",  "roll_deg",        "yaw_deg"};
  Json motion;
  for (const MonitorLine& line : lines) {
    if (!(line.*numbers)) continue;
    for (std::size_t i = 0; i < kKeys.size(); ++i) {
      const double value =
          (line.*numbers)->value[static_cast<Eigen::Index>(i)] / (i < 3 ? kMillimetre : kDegree);
      Json& axis = motion[kKeys[i]];
      if (axis.is_null()) axis = {{"least", value}, {"most", value}, {"last", value}};
      axis["least"] = std::min(axis["least"].get<double>(), value);
      axis["most"] = std::max(axis["most"].get<double>(), value);
      axis["last"] = value;
    }
  }
  return motion;
}

}  // namespace

Json MonitoringReport(const StoredMonitoring& stored) {
  const std::vector<MonitorLine>& lines = stored.record.lines;
  const Times times = TimesOf(lines);
  Json events = MonitoringEvents(lines), said = Json::array();
  const std::size_t num_events = events.size();
  if (num_events > kMostEventsShown) events.erase(events.begin() + kMostEventsShown, events.end());
  for (Json& event : events) event["time_s"] = event["time_s"].get<double>() - lines[0].time_s;
  for (const nlohmann::json& event : stored.events) {
    if (said.size() < kMostEventsShown) said.emplace_back(event);
  }
  return {{"head", stored.head},
          {"is_cut_off", stored.is_cut_off},
          {"frames", lines.size()},
          {"seconds", lines.empty() ? 0.0 : lines.back().time_s - lines.front().time_s},
          {"states_s", times.states},
          {"advice_s", times.advice},
          {"gaps_s", times.gaps_s},
          {"holds", HoldsOf(lines)},
          {"drift", MonitoringDrift(lines)},
          {"since_zero", MotionOf(lines, &MonitorLine::since_zero)},
          {"against_reference", MotionOf(lines, &MonitorLine::against_reference)},
          {"num_events", num_events},
          {"events", events},
          {"said", said}};
}

}  // namespace plumb
