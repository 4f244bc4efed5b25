#include "daemon/records/store_json.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"

namespace plumb {
namespace {

using Json = nlohmann::json;

std::optional<double> Number(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? std::optional<double>(found->get<double>())
                                                   : std::nullopt;
}

web::SixNumbers NumbersOf(const Json& json) {
  return {.vertical_mm = Number(json, "vertical_mm"),
          .longitudinal_mm = Number(json, "longitudinal_mm"),
          .lateral_mm = Number(json, "lateral_mm"),
          .pitch_deg = Number(json, "pitch_deg").value_or(0.0),
          .roll_deg = Number(json, "roll_deg").value_or(0.0),
          .yaw_deg = Number(json, "yaw_deg").value_or(0.0)};
}

void ReadWords(const Json& result, web::ResultSummary& summary) {
  const auto text = [](const Json& json, const char* key) {
    const auto found = json.find(key);
    return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  if (const auto words = result.value(Json::json_pointer("/correction/words"), Json());
      words.is_object()) {
    summary.words = {text(words, "vertical"), text(words, "longitudinal"), text(words, "lateral"),
                     text(words, "pitch"),    text(words, "roll"),         text(words, "yaw")};
  }
  const auto parts = result.value(Json::json_pointer("/body/parts"), Json());
  for (const Json& part : parts.is_array() ? parts : Json::array()) {
    if (!part.is_object()) continue;
    if (std::string words = text(part, "words_now"); !words.empty())
      summary.body_now.push_back(std::move(words));
    if (std::string words = text(part, "words_after"); !words.empty())
      summary.body_after.push_back(std::move(words));
  }
}

}  // namespace

std::string PlanJson(const web::ReferencePlan& plan) {
  Json json = {{"region_m", plan.region_m},
               {"shift_tolerance_mm", plan.tolerance.shift_mm},
               {"rotation_tolerance_deg", plan.tolerance.rotation_deg},
               {"posture", plan.posture},
               {"couch_markers", plan.couch_markers}};
  if (plan.isocentre_m) json["isocentre_m"] = *plan.isocentre_m;
  return json.dump();
}

web::ReferencePlan ParsePlan(const std::string& text) {
  web::ReferencePlan plan;
  const Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return plan;
  plan.region_m = json.value("region_m", plan.region_m);
  plan.tolerance.shift_mm = json.value("shift_tolerance_mm", plan.tolerance.shift_mm);
  plan.tolerance.rotation_deg = json.value("rotation_tolerance_deg", plan.tolerance.rotation_deg);
  plan.posture = json.value("posture", plan.posture);
  plan.couch_markers = json.value("couch_markers", plan.couch_markers);
  if (json.contains("isocentre_m"))
    plan.isocentre_m = json["isocentre_m"].get<std::array<double, 3>>();
  return plan;
}

std::string SettingsJson(const web::Settings& s) {
  return Json{{"shift_tolerance_mm", s.tolerance.shift_mm},
              {"rotation_tolerance_deg", s.tolerance.rotation_deg},
              {"posture", s.posture},
              {"couch_markers", s.couch_markers},
              {"auto_stop_s", s.auto_stop_s},
              {"scan_limit_s", s.scan_limit_s},
              {"keep_recordings", s.keep_recordings},
              {"retention_days", s.retention_days},
              {"idle_logout_min", s.idle_logout_min}}
      .dump();
}

web::Settings ParseSettings(const std::string& text) {
  web::Settings s;
  const Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return s;
  s.tolerance.shift_mm = json.value("shift_tolerance_mm", s.tolerance.shift_mm);
  s.tolerance.rotation_deg = json.value("rotation_tolerance_deg", s.tolerance.rotation_deg);
  s.posture = json.value("posture", s.posture);
  s.couch_markers = json.value("couch_markers", s.couch_markers);
  s.auto_stop_s = json.value("auto_stop_s", s.auto_stop_s);
  s.scan_limit_s = json.value("scan_limit_s", s.scan_limit_s);
  s.keep_recordings = json.value("keep_recordings", s.keep_recordings);
  s.retention_days = json.value("retention_days", s.retention_days);
  s.idle_logout_min = json.value("idle_logout_min", s.idle_logout_min);
  return s;
}

web::ResultSummary SummaryOf(const std::string& result_json) {
  const Json json = Json::parse(result_json, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object() || !json.contains("verdict") || !json["verdict"].is_string()) {
    throw DataError("a stored result has no verdict: the database was changed from outside");
  }
  web::ResultSummary summary{.verdict = json["verdict"].get<std::string>(),
                             .reasons = {},
                             .correction = {},
                             .u95 = {},
                             .words = {},
                             .body_now = {},
                             .body_after = {}};
  ReadWords(json, summary);
  if (const auto reasons = json.find("reasons"); reasons != json.end() && reasons->is_array()) {
    for (const Json& reason : *reasons)
      summary.reasons.push_back(reason.is_string() ? reason.get<std::string>() : reason.dump());
  }
  if (const auto correction = json.find("correction");
      correction != json.end() && correction->is_object()) {
    summary.correction = NumbersOf(*correction);
    if (const auto u95 = correction->find("uncertainty");
        u95 != correction->end() && u95->is_object())
      summary.u95 = NumbersOf(*u95);
  }
  return summary;
}

}  // namespace plumb
