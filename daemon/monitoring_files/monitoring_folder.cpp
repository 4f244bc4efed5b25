// SPDX-License-Identifier: Apache-2.0
#include "daemon/monitoring_files/monitoring_folder.hpp"

#include <algorithm>
#include <iterator>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/message_json.hpp"
#include "algo/base/statistics.hpp"
#include "algo/base/units.hpp"
#include "drivers/files/file_io.hpp"
#include "words/output.hpp"

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<const char*, 6> kColumns = {"lateral", "longitudinal", "vertical",
                                                 "pitch",   "roll",         "yaw"};

const char* UnitOfColumn(std::size_t i) { return i < 3 ? "mm" : "deg"; }

double InUnit(double value, std::size_t i) { return value / (i < 3 ? kMillimetre : kDegree); }

std::string Columns(const std::string& prefix) {
  std::string text;
  for (const char* u95 : {"", "_u95"}) {
    for (std::size_t i = 0; i < kColumns.size(); ++i)
      text += fmt::format(",{}{}{}_{}", prefix, kColumns[i], u95, UnitOfColumn(i));
  }
  return text;
}

std::string Cells(const std::optional<LiveNumbers>& numbers) {
  std::string text;
  for (const bool u95 : {false, true}) {
    for (std::size_t i = 0; i < kColumns.size(); ++i) {
      text += ',';
      if (!numbers) continue;
      const Vector6d& values = u95 ? numbers->u95 : numbers->value;
      text += fmt::format("{:.4f}", InUnit(values[static_cast<Eigen::Index>(i)], i));
    }
  }
  return text;
}

std::string Cell(const std::optional<double>& value, int digits = 4) {
  return value ? fmt::format(",{:.{}f}", *value, digits) : ",";
}

Json Rows(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json ZeroOf(const MonitoringRecord& record) {
  if (!record.zero_time_s) return nullptr;
  Json spread, sensors = Json::array();
  for (Eigen::Index i = 0; i < 3; ++i) {
    spread["rotation_deg"].push_back(record.spread_at_zero[i] / kDegree);
    spread["translation_mm"].push_back(record.spread_at_zero[i + 3] / kMillimetre);
  }
  for (const SensorZero& sensor : record.sensors) {
    Json shift = Rows(sensor.T_since_scan * record.centroid_m - record.centroid_m);
    for (Json& value : shift) value = value.get<double>() / kMillimetre;
    sensors.push_back(
        {{"takes_part", sensor.takes_part},
         {"frames", sensor.frames},
         {"static_error_sigmas", sensor.static_error},
         {"since_scan",
          {{"shift_mm", shift}, {"turn_deg", RotationAngle(sensor.T_since_scan) / kDegree}}},
         {"markers", sensor.place.markers},
         {"marker_residual_px", sensor.place.residual_px}});
  }
  Json zero = {{"time_s", *record.zero_time_s}, {"spread_of_a_frame", spread}};
  // Of one sensor, its own are those of the zero.
  if (sensors.size() == 1) {
    sensors.front().erase("takes_part");
    zero.update(sensors.front());
  } else {
    zero["sensors"] = sensors;
  }
  return zero;
}

Json BreathingOf(const BreathingMode* mode) {
  if (mode == nullptr) return nullptr;
  return {{"period_s", mode->period_s},
          {"amplitude_mm", mode->amplitude_m / kMillimetre},
          {"end_expiration_mm", 0.0},
          {"with_lag", !mode->lag.empty()},
          {"shares", mode->shares}};
}

}  // namespace

Json MonitoringEvents(const std::vector<MonitorLine>& lines) {
  Json events = Json::array();
  const auto add = [&](const MonitorLine& line, std::string_view what) {
    events.push_back({{"time_s", line.time_s}, {"event", what}});
  };
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const MonitorLine& line = lines[k];
    const bool first = k == 0;
    if (first || line.state != lines[k - 1].state) {
      add(line, Name(line.state));
      if (line.reason != BlindReason::kNone) events.back()["reason"] = Name(line.reason);
    }
    if (!first && line.advice != lines[k - 1].advice)
      add(line, fmt::format("advice_{}", Name(line.advice)));
    if (!first && line.couch_moved && !lines[k - 1].couch_moved) add(line, "couch_moved");
    if (!first && line.sensors_used != lines[k - 1].sensors_used && line.sensors_used > 0 &&
        lines[k - 1].sensors_used > 0)
      add(line, fmt::format("sensors_used_{}", line.sensors_used));
    if (!first && line.time_s - lines[k - 1].time_s > kLongestGap_s) add(line, "gap");
  }
  return events;
}

Json MonitoringDrift(const std::vector<MonitorLine>& lines) {
  double least = 1.0, most = 1.0, last = 1.0;
  for (const MonitorLine& line : lines) {
    if (line.state < MonitorState::kMonitoring) continue;
    last = line.drift;
    least = std::min(least, last);
    most = std::max(most, last);
  }
  return {{"least", least}, {"most", most}, {"last", last}};
}

Json MonitoringZero(const MonitoringRecord& record) {
  return {{"zero", ZeroOf(record)}, {"breathing", BreathingOf(record.breathing())}};
}

OutputKind MonitoringOutput() {
  return {say::output::Monitoring(), "monitor.json", {"monitor.json", "monitor.csv"}};
}

void MonitoringRecord::Describe(const Monitor& monitor, const MonitorOptions& options) {
  limits = options.limits;
  zeroing_s = options.zeroing_s;
  has_reference = options.judges_reference;
  if (options.accepted) reference_centroid_m = options.accepted->centroid_m;
  centroid_m = monitor.scene().centroid_m;
  zero_time_s = monitor.zero_time_s();
  spread_at_zero = monitor.spread_at_zero();
  sensors.clear();
  for (std::size_t i = 0; i < monitor.num_sensors(); ++i) {
    const SensorAtRest& sensor = monitor.sensor(i);
    sensors.push_back({.takes_part = monitor.takes_part(i),
                       .T_since_scan = sensor.since_scan().T,
                       .place = sensor.place(),
                       .frames = sensor.frames_in_zero(),
                       .static_error = sensor.static_error(),
                       .breathing = sensor.breathing()});
  }
}

const BreathingMode* MonitoringRecord::breathing() const {
  for (const SensorZero& sensor : sensors) {
    if (sensor.takes_part && sensor.breathing) return &*sensor.breathing;
  }
  return nullptr;
}

std::vector<MonitorLine> MonitoringRecord::judged() const {
  std::vector<MonitorLine> judged;
  std::ranges::copy_if(lines, std::back_inserter(judged), &MonitorLine::takes_part);
  return judged;
}

bool MonitoringRecord::began() const {
  return std::any_of(lines.begin(), lines.end(), [](const MonitorLine& line) {
    return line.state == MonitorState::kMonitoring;
  });
}

std::string MonitoringCsv(const MonitoringRecord& record) {
  std::string text = "time_s,state,advice" + Columns("") + ",breathing_mm";
  if (record.has_reference) text += Columns("ref_");
  text +=
      ",visible,residual,drift,support_rise_mm,markers_seen,couch_moved,reason,sensor,sensors_"
      "used\n";
  for (const MonitorLine& line : record.lines) {
    const auto mm = [](const std::optional<double>& value) -> std::optional<double> {
      if (!value) return std::nullopt;
      return *value / kMillimetre;
    };
    text += fmt::format("{:.6f},{},{}", line.time_s, Name(line.state), Name(line.advice));
    text += Cells(line.since_zero) + Cell(mm(line.breathing_m));
    if (record.has_reference) text += Cells(line.against_reference);
    const bool measured = line.visible > 0;
    text += Cell(measured ? std::optional(line.visible) : std::nullopt);
    text += Cell(measured ? std::optional(line.residual) : std::nullopt);
    text += Cell(line.drift, 6) + Cell(mm(line.support_rise_m));
    text += fmt::format(",{},{},{},{},{}\n", line.markers_seen, line.couch_moved ? 1 : 0,
                        line.reason == BlindReason::kNone ? "" : Name(line.reason), line.sensor + 1,
                        line.sensors_used);
  }
  return text;
}

std::string MonitoringJson(const MonitoringRecord& record) {
  std::map<std::string, std::size_t> states, advice;
  const std::vector<MonitorLine> lines = record.judged();
  for (const MonitorLine& line : lines) {
    ++states[std::string(Name(line.state))];
    ++advice[std::string(Name(line.advice))];
  }
  Json timings = nullptr;
  if (!record.cpu_s.empty()) {
    std::vector<double> cpu_s = record.cpu_s;
    timings = {{"cpu_median", TakeMedian(cpu_s) * 1e3},
               {"cpu_p95", TakeQuantile(cpu_s, 0.95) * 1e3}};
  }
  const Json json = {{"format", 1},
                     {"version", PLUMB_VERSION},
                     {"frame", "reference_marker"},
                     {"centroid", Rows(record.centroid_m)},
                     {"reference_centroid",
                      record.reference_centroid_m ? Rows(*record.reference_centroid_m) : Json()},
                     {"settings",
                      {{"shift_tolerance_mm", record.limits.shift_tolerance_m / kMillimetre},
                       {"rotation_tolerance_deg", record.limits.rotation_tolerance_rad / kDegree},
                       {"zeroing_s", record.zeroing_s},
                       {"judges", record.has_reference ? "against_reference" : "since_zero"}}},
                     {"zero", ZeroOf(record)},
                     {"drift", MonitoringDrift(lines)},
                     {"breathing", BreathingOf(record.breathing())},
                     {"frames", record.lines.size()},
                     {"states", states},
                     {"advice", advice},
                     {"events", MonitoringEvents(lines)},
                     {"warnings", EnglishTexts(record.warnings)},
                     {"timings_ms_per_frame", timings}};
  return json.dump(1) + "\n";
}

void WriteMonitoring(const MonitoringRecord& record, const std::filesystem::path& folder) {
  AtomicFolder output(folder, MonitoringOutput());
  WriteWholeFile(output.path() / "monitor.csv", MonitoringCsv(record));
  WriteWholeFile(output.path() / "monitor.json", MonitoringJson(record));
  output.Commit();
}

}  // namespace plumb
