// SPDX-License-Identifier: Apache-2.0
// What live monitoring says now.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "algo/base/message.hpp"
#include "algo/base/message_json.hpp"
#include "web/model/numbers.hpp"

namespace plumb {

/// Six numbers with the half-widths of their 95 % intervals: of live monitoring a motion of the
/// body, of a sweep the correction.
struct MotionNumbers {
  std::array<double, kNumberAxes.size()> value{}, u95{};  ///< In the order and units of the axes.
};

/// A window about a level of the breath that was taught.
struct BreathHold {
  double level_mm = 0.0, window_mm = 0.0;
  std::string advice = "unknown";  ///< Of the breath alone.
};

/// A position that a person signed while it was monitored.
struct AcceptedLive {
  std::string by, at, reason;  ///< At: UTC. Reason: empty for one that was in.
  MotionNumbers against_reference = {};
};

/// One of two sensors.
struct MonitorSensor {
  std::string serial, share;  ///< Share: used, covered, no_image, moved, left_out.
};

/// Numbers are never older than a second, and not judged after 150 ms: then state, advice and
/// reason say so.
struct MonitorStatus {
  bool active = false;
  std::string scan_id = {}, patient_id = {};
  std::string state = {};            ///< mounting, zeroing, monitoring, blind, moved_sensor.
  std::string advice = "unknown";    ///< in, out, unknown.
  std::string reason = "none";       ///< Of blind: as BlindReason, or no_image.
  std::optional<double> age_s = {};  ///< Since the image arrived on which all this rests.
  bool is_old = false;               ///< Over 200 ms: shown grey.
  std::optional<MotionNumbers> since_zero = {}, against_reference = {};
  bool judges_reference = false;  ///< The advice is of the numbers against the reference.
  double shift_tolerance_mm = 0.0, rotation_tolerance_deg = 0.0;
  bool has_breathing = false;
  std::optional<double> breathing_mm = {};
  std::optional<BreathHold> breath_hold = {};
  std::optional<AcceptedLive> accepted = {};  ///< The last one of this session.
  bool couch_moved = false;
  std::int64_t frames = 0, frames_dropped = 0;
  double elapsed_s = 0.0;
  /// From an image's arrival to its numbers: 95th percentile of the last seconds.
  std::optional<double> latency_ms = {};
  std::optional<double> cpu_ms = {};        ///< Of one processor for each image, in the mean.
  std::vector<MonitorSensor> sensors = {};  ///< Empty with one.
  Message one_sensor = {};                  ///< Of two, one alone is used, and why.
  std::vector<Message> warnings = {};
  Message ended = {};  ///< Not active: why it could not go on; empty if it was ended.
  bool has_record = false;
  bool is_recorded = false;  ///< On the disk, beside the scan.
};

/// Null without numbers; names as in monitor.csv.
inline nlohmann::json MotionJson(const std::optional<MotionNumbers>& numbers) {
  if (!numbers) return nullptr;
  nlohmann::json json;
  for (std::size_t i = 0; i < kNumberAxes.size(); ++i) {
    const NumberAxis& axis = kNumberAxes[i];
    json[axis.key] = numbers->value[i];
    json[std::string(axis.name) + "_u95_" + axis.unit] = numbers->u95[i];
  }
  return json;
}

inline nlohmann::json BreathHoldJson(const std::optional<BreathHold>& hold) {
  if (!hold) return nullptr;
  return {{"level_mm", hold->level_mm}, {"window_mm", hold->window_mm}, {"advice", hold->advice}};
}

inline nlohmann::json AcceptedJson(const std::optional<AcceptedLive>& accepted) {
  if (!accepted) return nullptr;
  return {{"by", accepted->by},
          {"at", accepted->at},
          {"reason", accepted->reason},
          {"numbers", MotionJson(accepted->against_reference)}};
}

inline nlohmann::json SensorsJson(const std::vector<MonitorSensor>& sensors) {
  nlohmann::json json = nlohmann::json::array();
  for (const MonitorSensor& sensor : sensors)
    json.push_back({{"serial", sensor.serial}, {"share", sensor.share}});
  return json;
}

inline nlohmann::json MonitorJson(const MonitorStatus& status) {
  const auto or_null = [](const std::optional<double>& value) {
    return value ? nlohmann::json(*value) : nlohmann::json(nullptr);
  };
  return {{"active", status.active},
          {"scan", status.scan_id},
          {"state", status.active ? nlohmann::json(status.state) : nlohmann::json(nullptr)},
          {"advice", status.advice},
          {"reason", status.reason},
          {"age_s", or_null(status.age_s)},
          {"is_old", status.is_old},
          {"since_zero", MotionJson(status.since_zero)},
          {"against_reference", MotionJson(status.against_reference)},
          {"judges", status.judges_reference ? "against_reference" : "since_zero"},
          {"shift_tolerance_mm", status.shift_tolerance_mm},
          {"rotation_tolerance_deg", status.rotation_tolerance_deg},
          {"has_breathing", status.has_breathing},
          {"breathing_mm", or_null(status.breathing_mm)},
          {"breath_hold", BreathHoldJson(status.breath_hold)},
          {"accepted", AcceptedJson(status.accepted)},
          {"couch_moved", status.couch_moved},
          {"frames", status.frames},
          {"frames_dropped", status.frames_dropped},
          {"elapsed_s", status.elapsed_s},
          {"latency_p95_ms", or_null(status.latency_ms)},
          {"cpu_ms_per_frame", or_null(status.cpu_ms)},
          {"sensors", SensorsJson(status.sensors)},
          {"one_sensor", status.one_sensor.English()},
          {"one_sensor_message", status.one_sensor.empty()
                                     ? nlohmann::json(nullptr)
                                     : nlohmann::json(MessageJson(status.one_sensor))},
          {"has_record", status.has_record},
          {"is_recorded", status.is_recorded},
          {"warnings", EnglishTexts(status.warnings)},
          {"warning_messages", MessagesJson(status.warnings)},
          {"ended", status.ended.English()},
          {"ended_message", status.ended.empty() ? nlohmann::json(nullptr)
                                                 : nlohmann::json(MessageJson(status.ended))}};
}

}  // namespace plumb
