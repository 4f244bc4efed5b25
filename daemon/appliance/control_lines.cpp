#include "daemon/appliance/control_lines.hpp"

#include <chrono>

#include <nlohmann/json.hpp>

#include "daemon/control/control_protocol.hpp"

namespace plumb {

using Json = nlohmann::json;

Json IgnoredEvent(ScanEvent what, ApplianceState state, const std::string& reason) {
  return {{"event", "ignored"}, {"what", Name(what)}, {"state", Name(state)}, {"reason", reason}};
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

Json ResultEvent(const std::string& scan, const std::string& answer) {
  return {{"event", "result"}, {"scan", scan}, {"answer", answer}};
}

Json SensorChanged(const SensorEvent& event) {
  static constexpr auto kNames =
      NamesUpTo<SensorEvent::Kind::kStalled>({"ready", "lost", "failed", "others", "stalled"});
  return {{"event", "sensor"},
          {"what", kNames.at(static_cast<std::size_t>(event.kind))},
          {"serial", event.sensor.serial},
          {"reason", event.reason},
          {"others", event.others}};
}

Json StateEvent(ApplianceState state, const std::string& reason, bool cancelling) {
  return {
      {"event", "state"}, {"state", Name(state)}, {"reason", reason}, {"cancelling", cancelling}};
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
  return {{"step", update.step},
          {"fraction", update.fraction},
          {"frames", update.frames},
          {"frames_tracked", update.frames_tracked},
          {"frames_dropped", update.frames_dropped},
          {"guidance", Name(update.guidance.advice)},
          {"speed_m_s", update.guidance.speed_m_s},
          {"median_depth_m", update.guidance.median_depth_m},
          {"area_m2", update.guidance.area_m2},
          {"coverage", coverage ? Json(*coverage) : Json(nullptr)}};
}

std::string_view Name(IndicatorPattern pattern) {
  static constexpr auto kNames = NamesUpTo<IndicatorPattern::kStopped>(
      {"off", "no_sensor", "ready", "scanning", "too_fast", "too_near", "too_far", "working",
       "done", "result_in_tolerance", "result_unsure", "result_move", "no_answer", "fault",
       "ready_rolled_back", "ready_disk_nearly_full", "stopped"});
  return kNames.at(static_cast<std::size_t>(pattern));
}

}  // namespace plumb
