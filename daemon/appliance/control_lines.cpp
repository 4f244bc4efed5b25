#include "daemon/appliance/control_lines.hpp"

#include <chrono>

#include <nlohmann/json.hpp>

#include "daemon/control/control_protocol.hpp"

namespace plumb {
namespace {

using Json = nlohmann::json;

Json FieldsOf(const IgnoredEvent& event) {
  return {{"event", "ignored"},
          {"what", Name(event.what)},
          {"state", Name(event.state)},
          {"reason", event.reason}};
}
Json FieldsOf(const LightEvent& event) {
  return {{"event", "light"}, {"pattern", Name(event.pattern)}};
}
Json FieldsOf(const ProgressEvent& event) {
  Json fields = ProgressFields(event.update, event.coverage);
  fields["event"] = "progress";
  fields["scan"] = event.scan;
  return fields;
}
Json FieldsOf(const ResultEvent& event) {
  return {{"event", "result"}, {"scan", event.scan}, {"answer", event.answer}};
}
Json FieldsOf(const SensorEvent& event) {
  static constexpr auto kNames =
      NamesUpTo<SensorEvent::Kind::kStalled>({"ready", "lost", "failed", "others", "stalled"});
  return {{"event", "sensor"},
          {"what", kNames.at(static_cast<std::size_t>(event.kind))},
          {"serial", event.sensor.serial},
          {"reason", event.reason},
          {"others", event.others}};
}
Json FieldsOf(const StateEvent& event) {
  return {{"event", "state"},
          {"state", Name(event.state)},
          {"reason", event.reason},
          {"cancelling", event.cancelling}};
}

std::string WithTime(Json fields) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  fields["time"] = std::chrono::duration<double>(now).count();
  return ControlLine(fields);
}

}  // namespace

std::string EventLine(const WatchedEvent& event) {
  return WithTime(std::visit([](const auto& one) { return FieldsOf(one); }, event));
}

std::string StatusEventLine(const nlohmann::json& status) {
  return WithTime({{"event", "status"}, {"status", status}});
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
