// SPDX-License-Identifier: Apache-2.0
#include "web/exchange/json.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "algo/base/message_json.hpp"
#include "words/result.hpp"
#include "words/text.hpp"

namespace plumb::web {
namespace {

Json TextOrNull(const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); }

Json NumbersJson(const std::optional<ReportedNumbers>& numbers) {
  if (!numbers) return nullptr;
  Json json;
  for (const NumberAxis& axis : kNumberAxes) json[axis.key] = axis.In(numbers);
  return json;
}

Json LiveScanJson(const LiveScan& scan) {
  Json json = {{"id", scan.id},
               {"patient_id", TextOrNull(scan.patient_id)},
               {"purpose", Name(scan.purpose)},
               {"elapsed_s", scan.elapsed_s},
               {"coverage", scan.coverage},
               {"without_new_surface_s", scan.without_new_surface_s},
               {"guidance", Name(scan.guidance)},
               {"keyframes", scan.keyframes},
               {"frames", scan.frames},
               {"frames_tracked", scan.frames_tracked},
               {"frames_dropped", scan.frames_dropped},
               {"step_fraction", scan.step_fraction},
               {"forming", FormingJson(scan.forming)}};
  PutMessage(json, "step", scan.step, "");
  return json;
}

}  // namespace

void PutMessage(Json& json, const std::string& key, const Message& message, const Json& absent) {
  json[key] = message.empty() ? absent : Json(message.English());
  json[key + "_message"] = message.empty() ? Json(nullptr) : MessageJson(message);
}

void PutMessages(Json& json, const std::string& key, const std::vector<Message>& messages) {
  json[key + "s"] = EnglishTexts(messages);
  json[key + "_messages"] = MessagesJson(messages);
}

std::string Dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Response JsonResponse(const Json& json, int status) {
  Response response = BodyResponse("application/json", Dump(json));
  response.status = status;
  return response;
}

std::string TimeText(WallClock::time_point time) {
  return TimeText(WallClock::to_time_t(std::chrono::floor<std::chrono::seconds>(time)));
}

std::string TimeText(std::time_t time) {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(time));
}

namespace {

/// A failed check also counts as overdue, for clients that know only that field.
void AddDailyCheck(Json& json, DailyCheck check, const char* overdue, const char* failed) {
  json[overdue] = check != DailyCheck::kPassed;
  json[failed] = check == DailyCheck::kFailed;
}

Json WordsJson(const std::array<Message, 6>& words) {
  Json json;
  for (std::size_t i = 0; i < words.size(); ++i) PutMessage(json, kNumberAxes[i].name, words[i]);
  return json;
}

/// Names of the six numbers.
Json AxesJson(const ResultSummary& result) {
  std::array<Message, 6> names = result.axes;
  for (std::size_t i = 0; i < names.size(); ++i)
    if (names[i].empty()) names[i] = AxisName(i);
  return WordsJson(names);
}

/// The six numbers as every presentation shows them; none without an answer.
Json RowsJson(const ResultSummary& result) {
  Json rows = Json::array();
  for (const ShownRow& row : ShownRows(result)) {
    const NumberAxis& axis = kNumberAxes[row.number];
    Json json = {{"name", axis.name},
                 {"key", axis.key},
                 {"unit", axis.symbol()},
                 {"value", row.value},
                 {"u95", row.u95},
                 {"tolerance", row.tolerance},
                 {"judgement", Name(row.judgement)},
                 {"still", IsStill(row)}};
    PutMessage(json, "judged", JudgementWord(row.judgement));
    PutMessage(json, "way", WayOf(row, result.verdict));
    rows.push_back(std::move(json));
  }
  return rows;
}

Json BodyJson(const ResultSummary& result) {
  return {{"now", EnglishTexts(result.body_now)},
          {"now_messages", MessagesJson(result.body_now)},
          {"after", EnglishTexts(result.body_after)},
          {"after_messages", MessagesJson(result.body_after)}};
}

}  // namespace

Json ToJson(const Scan& scan, WallClock::time_point now) {
  Json json = {{"id", scan.id},
               {"patient_id", TextOrNull(scan.patient_id)},
               {"reference_id", TextOrNull(scan.reference_id)},
               {"purpose", Name(scan.purpose)},
               {"outcome", Name(scan.outcome)},
               {"started_at", scan.started_at},
               {"finished_at", scan.finished_at},
               {"age_s", nullptr},
               {"accepted_by", TextOrNull(scan.accepted_by)},
               {"accepted_reason", TextOrNull(scan.accepted_reason)},
               {"accepted_at", scan.accepted_at},
               {"session_id", TextOrNull(scan.session_id)},
               {"fraction", scan.fraction > 0 ? Json(scan.fraction) : Json(nullptr)},
               {"sensor_on_s", scan.sensor_on_s},
               {"result", nullptr}};
  PutMessage(json, "failure", scan.failure);
  AddDailyCheck(json, scan.daily_check, "check_overdue", "check_failed");
  if (scan.finished_at) {
    // An end in the future: the clock has stepped, and the age is unknown.
    if (scan.age_s)
      json["age_s"] = static_cast<std::int64_t>(*scan.age_s);
    else if (now >= *scan.finished_at)
      json["age_s"] =
          std::chrono::duration_cast<std::chrono::seconds>(now - *scan.finished_at).count();
  }
  if (scan.result) {
    // The numbers of a comparison without an answer must not be acted on.
    const bool is_answer = scan.result->verdict != Verdict::kNoAnswer;
    json["result"] = {
        {"verdict", Name(scan.result->verdict)},
        {"correction", NumbersJson(is_answer ? scan.result->correction : std::nullopt)},
        {"u95", NumbersJson(is_answer ? scan.result->u95 : std::nullopt)},
        {"words", WordsJson(is_answer ? scan.result->words : std::array<Message, 6>())},
        {"axes", AxesJson(*scan.result)},
        {"numbers", RowsJson(*scan.result)},
        {"along_couch", RunsAlongCouch(*scan.result)},
        {"body", BodyJson(*scan.result)}};
    PutMessage(json["result"], "about", scan.result->about);
    PutMessages(json["result"], "reason", scan.result->reasons);
  }
  return json;
}

Json ListJson(const std::vector<Scan>& scans, WallClock::time_point now) {
  Json list = Json::array();
  for (const Scan& scan : scans) list.push_back(ToJson(scan, now));
  return list;
}

namespace {

Json CheckJson(const CheckRecord& check, WallClock::time_point now) {
  Json items = Json::array();
  for (const CheckItem& item : check.items) {
    Json shown = {{"name", item.name},
                  {"value", item.value},
                  {"limit", item.limit},
                  {"unit", item.unit},
                  {"passed", item.passed}};
    PutMessage(shown, "note", item.note);
    items.push_back(std::move(shown));
  }
  Json json = {
      {"id", check.id},
      {"time", check.time},
      {"age_s", std::max<std::int64_t>(
                    0, std::chrono::duration_cast<std::chrono::seconds>(now - check.time).count())},
      {"user", check.user},
      {"sensor_serial", check.sensor_serial},
      {"status", Name(check.status)},
      {"items", items},
      {"num_markers", check.num_markers}};
  PutMessages(json, "reason", check.reasons);
  PutMessages(json, "caution", check.cautions);
  return json;
}

}  // namespace

Json ToJson(const ScanQuality& quality) {
  Json json = {{"rows", Json::array()}};
  for (const QualityRow& row : quality.rows) {
    Json& shown = json["rows"].emplace_back(Json{{"is_caution", row.is_caution}});
    PutMessage(shown, "name", row.name);
    PutMessage(shown, "value", row.value);
  }
  PutMessages(json, "caution", quality.cautions);
  PutMessages(json, "remark", quality.remarks);
  PutMessage(json, "why_not_accept", quality.why_not_accept);
  return json;
}

Json ToJson(const CheckStatus& checks, WallClock::time_point now) {
  Json json = {{"checks", Json::array()}, {"baseline", nullptr}};
  AddDailyCheck(json, checks.today, "overdue", "failed");
  PutMessages(json, "change", checks.changes);
  for (const CheckRecord& check : checks.checks) json["checks"].push_back(CheckJson(check, now));
  if (checks.baseline) {
    json["baseline"] = {{"check_id", checks.baseline->check_id},
                        {"set_at", checks.baseline->set_at},
                        {"set_by", checks.baseline->set_by},
                        {"num_markers", checks.baseline->num_markers}};
  }
  return json;
}

namespace {

Json VersionJson(const std::optional<ReferenceVersion>& reference) {
  if (!reference) return nullptr;
  return {
      {"id", reference->id}, {"version", reference->version}, {"source", Name(reference->source)}};
}

Json SessionJson(const TreatmentSession& session) {
  Json reference = VersionJson(session.reference);
  if (session.reference_created_at) reference["created_at"] = *session.reference_created_at;
  return {{"id", session.id},
          {"patient_id", session.patient_id},
          {"patient_code", session.patient_code},
          {"purpose", Name(session.purpose)},
          {"fraction", session.fraction > 0 ? Json(session.fraction) : Json(nullptr)},
          {"num_scans", session.num_scans},
          {"opened_by", session.opened_by},
          {"opened_at", session.opened_at},
          {"has_unaccepted", session.has_unaccepted},
          {"reference", reference},
          {"newer_reference", VersionJson(session.newer_reference)},
          {"other_reference", VersionJson(session.other_reference)},
          {"language", TextOrNull(session.language)},
          {"sweep_hint", TextOrNull(session.sweep_hint)}};
}

Json CouchJson(const CouchProfile& couch) {
  Json json = {{"version", couch.version},
               {"name", couch.name},
               {"num_axes", couch.num_axes},
               {"is_in_cm", couch.is_in_cm},
               {"hides_rest", couch.hides_rest},
               {"wraps", couch.wraps},
               {"signed_by", TextOrNull(couch.signed_by)},
               {"signed_at", couch.version > 0 ? Json(couch.signed_at) : Json(nullptr)},
               {"axes", Json::object()}};
  for (std::size_t i = 0; i < kNumberAxes.size(); ++i) {
    const CouchAxis axis = CouchAxisOf(couch, i);
    json["axes"][kNumberAxes.at(i).name] = {{"factor", axis.factor},
                                            {"unit", axis.unit},
                                            {"digits", axis.digits},
                                            {"moves", axis.moves},
                                            {"period", axis.period}};
  }
  PutMessages(json, "note", CouchNotes(couch));
  PutMessage(json, "apply", CouchApply(couch));
  PutMessage(json, "cannot", say::result::CouchCannot());
  return json;
}

Json WaitingJson(const std::vector<WaitingReference>& waiting) {
  Json list = Json::array();
  for (const WaitingReference& reference : waiting) {
    list.push_back(Json{{"reference_id", reference.reference_id},
                        {"patient_id", reference.patient_id},
                        {"patient_code", reference.patient_code},
                        {"version", reference.version},
                        {"planned_by", reference.planned_by}});
  }
  return list;
}

}  // namespace

Json ToJson(const Status& status, WallClock::time_point now) {
  Json json = {
      {"state", Name(status.state)},
      {"fault_kind", Name(status.fault_kind)},
      {"sensor",
       {{"present", status.sensor.present},
        {"serial", status.sensor.serial},
        {"name", status.sensor.name},
        {"fps", status.sensor.frames_per_second},
        {"powered_s", status.sensor.powered_s},
        {"warm_up_s", status.sensor.warm_up_s}}},
      {"storage",
       {{"free_bytes", status.storage.free_bytes},
        {"total_bytes", status.storage.total_bytes},
        {"writable", status.storage.writable}}},
      {"light", status.light},
      {"press", status.press_monitors ? "monitoring" : "sweep"},
      {"wants_wristband", status.wants_wristband},
      {"patient_id", TextOrNull(status.patient_id)},
      {"next_purpose", Name(status.next_purpose)},
      {"scans_today", status.scans_today},
      {"session", status.session ? SessionJson(*status.session) : Json(nullptr)},
      {"room", status.room},
      {"couch", CouchJson(status.couch)},
      {"waiting", WaitingJson(status.waiting)},
      {"scan", status.scan ? LiveScanJson(*status.scan) : Json(nullptr)},
      {"last_check", status.last_check ? CheckJson(*status.last_check, now) : Json(nullptr)},
      {"last_result", status.last_result ? ToJson(*status.last_result, now) : Json(nullptr)},
      {"time", now},
      {"version", status.version}};
  PutMessage(json, "fault", status.fault);
  PutMessage(json, "reference_block", status.reference_block);
  PutMessage(json, "rolled_back", status.rolled_back);
  PutMessages(json, "warning", status.warnings);
  PutMessages(json, "peer_note", status.peer_notes);
  PutMessages(json["storage"], "warning", status.storage.warnings);
  // This age decides what may be acted on, so the wall clock does not replace the steady one.
  if (status.last_result && !status.last_result->age_s) json["last_result"]["age_s"] = nullptr;
  if (status.last_result) json["last_result"]["superseded"] = status.last_result->is_superseded;
  AddDailyCheck(json, status.daily_check, "check_overdue", "check_failed");
  return json;
}

}  // namespace plumb::web

namespace plumb {

using web::Json;
using web::PutMessage;
using web::TextOrNull;

void to_json(Json& json, const Tolerance& tolerance) {
  json = {{"shift_mm", tolerance.shift_mm}, {"rotation_deg", tolerance.rotation_deg}};
}

void to_json(Json& json, const PlanTemplate& wanted) {
  json = {{"site", wanted.site},
          {"width_mm", wanted.width_mm},
          {"height_mm", wanted.height_mm},
          {"tolerance", wanted.tolerance},
          {"posture", TextOrNull(wanted.posture)},
          {"hint", wanted.hint},
          {"changed_by", wanted.changed_by}};
}

void to_json(Json& json, const MessageWay& way) {
  json = {{"name", way.name},
          {"sent", way.sent},
          {"failed", way.failed},
          {"waiting", way.waiting},
          {"sent_at", way.sent_at}};
  PutMessage(json, "failure", way.failure);
}

void to_json(Json& json, const Patient& patient) {
  json = {{"id", patient.id},
          {"code", patient.code},
          {"site", patient.site},
          {"created_at", patient.created_at},
          {"approved_reference_id", TextOrNull(patient.approved_reference_id)},
          {"num_scans", patient.num_scans},
          {"draft_reference_id", TextOrNull(patient.draft_reference_id)},
          {"note", patient.note},
          {"immobilisation", patient.immobilisation},
          {"alert", patient.alert},
          {"has_photo", patient.has_photo},
          {"has_drawing", patient.has_drawing},
          {"sheet_revision", patient.sheet_revision},
          {"archived", patient.archived},
          {"last_session", nullptr}};
  if (const auto& last = patient.last_session) {
    json["last_session"] = {{"id", last->id},
                            {"fraction", last->fraction},
                            {"num_scans", last->num_scans},
                            {"closed_at", last->closed_at}};
  }
}

namespace {

Json PlanJson(const ReferencePlan& plan) {
  Json region = Json::array();
  for (const auto& [x, y] : plan.region_m) region.push_back({x, y});
  return {{"region_m", region},
          {"isocentre_m", plan.isocentre_m},
          {"tolerance", plan.tolerance},
          {"posture", plan.posture},
          {"couch_markers", plan.couch_markers},
          {"clothing_mm", plan.clothing_mm},
          {"ct_breathing_mm", plan.ct_breathing_mm}};
}

}  // namespace

void to_json(Json& json, const RoomOnMap& room) {
  json = {{"gantry_xy", room.gantry_xy}, {"right_xy", room.right_xy}, {"known", room.is_known}};
  if (room.lasers_m) json["lasers_m"] = *room.lasers_m;
  if (room.contradicts_posture) json["contradicts_posture"] = true;
}

void to_json(Json& json, const Reference& reference) {
  json = {{"id", reference.id},
          {"patient_id", reference.patient_id},
          {"version", reference.version},
          {"source", Name(reference.origin.source)},
          {"scan_id", reference.scan_id},
          {"created_at", reference.created_at},
          {"created_by", reference.created_by},
          {"revision", reference.revision},
          {"digest", reference.digest},
          {"planned_by", TextOrNull(reference.planned_by)},
          {"approved_by", TextOrNull(reference.approved_by)},
          {"approved_at", reference.approved_at},
          {"plan", reference.unreadable.empty() ? PlanJson(reference.plan) : Json(nullptr)}};
  PutMessage(json, "reason", reference.reason, "");
  PutMessage(json, "unreadable", reference.unreadable);
}

void to_json(Json& json, const User& user) {
  json = {{"name", user.name},
          {"role", Name(user.role)},
          {"disabled", user.disabled},
          {"second_factor", user.has_second_factor},
          {"in_directory", IsInDirectory(user.password_hash)},
          {"created_at", user.created_at}};
}

void to_json(Json& json, const AuditEntry& entry) {
  json = {{"number", entry.number},   {"time", entry.time},     {"user", entry.user},
          {"address", entry.address}, {"action", entry.action}, {"subject", entry.subject},
          {"about", nullptr}};
  PutMessage(json, "detail", entry.detail, "");
  // A person's text, or an identifier: the action says what it means.
  if (entry.detail.Is(say::text::kVerbatim)) json["detail_message"] = nullptr;
  if (const auto& about = entry.about) {
    json["about"] = {{"kind", about->kind},
                     {"exists", about->exists},
                     {"patient_code", TextOrNull(about->patient_code)},
                     {"number", about->number > 0 ? Json(about->number) : Json(nullptr)},
                     {"time", about->time}};
  }
}

void to_json(Json& json, const UpdateStatus& update) {
  json = {{"supported", update.supported},   {"slot", update.slot},
          {"installing", update.installing}, {"fraction", update.fraction},
          {"bundles", update.bundles},       {"restart_needed", update.restart_needed}};
  PutMessage(json, "message", update.message, "");
  PutMessage(json, "failure", update.failure);
  PutMessage(json, "offered", update.offered);
  PutMessage(json, "channel_failure", update.channel_failure);
  PutMessage(json, "rolled_back", update.rolled_back);
}

}  // namespace plumb
