// SPDX-License-Identifier: Apache-2.0
#include "daemon/appliance/control_lines.hpp"

#include <chrono>

#include <nlohmann/json.hpp>

#include "algo/base/message_json.hpp"
#include "daemon/control/control_protocol.hpp"

namespace plumb {

namespace {

using Json = nlohmann::json;

}  // namespace

void PutMessage(Json& json, const std::string& key, const Message& message) {
  json[key] = message.English();
  json[key + "_message"] = message.empty() ? Json(nullptr) : Json(MessageJson(message));
}

void PutMessages(Json& json, const std::string& key, const std::vector<Message>& messages) {
  json[key + "s"] = EnglishTexts(messages);
  json[key + "_messages"] = Json(MessagesJson(messages));
}

Json IgnoredEvent(ScanEvent what, ApplianceState state, const Message& reason) {
  Json event = {{"event", "ignored"}, {"what", Name(what)}, {"state", Name(state)}};
  PutMessage(event, "reason", reason);
  return event;
}

Json LightEvent(IndicatorPattern pattern) {
  return {{"event", "light"}, {"pattern", Name(pattern)}};
}

Json ProgressEvent(const std::string& scan, const ScanUpdate& update,
                   std::optional<double> coverage) {
  Json event = ProgressFields(update, coverage);
  event["event"] = "progress";
  event["scan"] = scan;
  return event;
}

Json ResultEvent(const std::string& scan, const Message& answer) {
  Json event = {{"event", "result"}, {"scan", scan}};
  PutMessage(event, "answer", answer);
  return event;
}

Json SensorChanged(const SensorEvent& event) {
  static constexpr auto kNames =
      NamesUpTo<SensorEvent::Kind::kStalled>({"ready", "lost", "failed", "others", "stalled"});
  Json changed = {{"event", "sensor"},
                  {"what", kNames.at(static_cast<std::size_t>(event.kind))},
                  {"serial", event.sensor.serial},
                  {"others", event.others}};
  PutMessage(changed, "reason", event.reason);
  return changed;
}

Json StateEvent(ApplianceState state, const Message& reason, bool cancelling) {
  Json event = {{"event", "state"}, {"state", Name(state)}, {"cancelling", cancelling}};
  PutMessage(event, "reason", reason);
  return event;
}

std::string EventLine(Json event) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  event["time"] = std::chrono::duration<double>(now).count();
  return ControlLine(event);
}

std::string StatusEventLine(const Json& status) {
  return EventLine({{"event", "status"}, {"status", status}});
}

Json ProgressFields(const ScanUpdate& update, std::optional<double> coverage) {
  Json fields = {{"fraction", update.fraction},
                 {"frames", update.frames},
                 {"frames_tracked", update.frames_tracked},
                 {"frames_dropped", update.frames_dropped},
                 {"guidance", Name(update.guidance.advice)},
                 {"speed_m_s", update.guidance.speed_m_s},
                 {"median_depth_m", update.guidance.median_depth_m},
                 {"area_m2", update.guidance.area_m2},
                 {"coverage", coverage ? Json(*coverage) : Json(nullptr)},
                 {"forming", FormingJson(update.forming)}};
  PutMessage(fields, "step", update.step);
  return fields;
}

std::string_view Name(IndicatorPattern pattern) {
  static constexpr auto kNames = NamesUpTo<IndicatorPattern::kStopped>({"off",
                                                                        "no_sensor",
                                                                        "ready",
                                                                        "scanning",
                                                                        "too_fast",
                                                                        "too_near",
                                                                        "too_far",
                                                                        "working",
                                                                        "done",
                                                                        "result_in_tolerance",
                                                                        "result_unsure",
                                                                        "result_move",
                                                                        "no_answer",
                                                                        "fault",
                                                                        "ready_rolled_back",
                                                                        "ready_disk_nearly_full",
                                                                        "ready_guessed",
                                                                        "ready_to_monitor",
                                                                        "monitor_starting",
                                                                        "monitor_in",
                                                                        "monitor_out",
                                                                        "monitor_unknown",
                                                                        "stopped"});
  return kNames.at(static_cast<std::size_t>(pattern));
}

}  // namespace plumb
