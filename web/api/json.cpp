#include "web/api/json.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "algo/base/errors.hpp"
#include "web/http/checks.hpp"
#include "web/security/permissions.hpp"

namespace plumb::web {
namespace {

constexpr int kMaxDepth = 8;
constexpr double kMaxCoordinate_m = 100.0;
constexpr std::size_t kMaxRegionCorners = 500;
constexpr std::array<std::string_view, 6> kStates = {"no_sensor", "ready",  "scanning",
                                                     "working",   "result", "fault"};
constexpr std::array<std::string_view, 7> kGuidance = {
    "none", "slower", "closer", "farther", "tracking_lost", "no_markers", "computer_too_slow"};
constexpr std::array<std::string_view, 4> kFaultKinds = {"none", "sensor", "scan", "storage"};
constexpr std::array<std::string_view, 3> kPurposes = {"fraction", "reference", "daily_check"};
constexpr std::array<std::string_view, 4> kOutcomes = {"running", "done", "cancelled", "failed"};
constexpr std::array<std::string_view, 4> kPostures = {"HFS", "HFP", "FFS", "FFP"};

template <std::size_t n, typename Enum>
std::string_view NameIn(const std::array<std::string_view, n>& names, Enum value) {
  return names.at(static_cast<std::size_t>(value));
}

template <typename T>
Json OrNull(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json TextOrNull(const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); }

Json NumbersJson(const std::optional<SixNumbers>& numbers) {
  if (!numbers) return nullptr;
  return {{"vertical_mm", OrNull(numbers->vertical_mm)},
          {"longitudinal_mm", OrNull(numbers->longitudinal_mm)},
          {"lateral_mm", OrNull(numbers->lateral_mm)},
          {"pitch_deg", numbers->pitch_deg},
          {"roll_deg", numbers->roll_deg},
          {"yaw_deg", numbers->yaw_deg}};
}

Json ToleranceJson(const Tolerance& tolerance) {
  return {{"shift_mm", tolerance.shift_mm}, {"rotation_deg", tolerance.rotation_deg}};
}

Json LiveScanJson(const LiveScan& scan) {
  return {{"id", scan.id},
          {"patient_id", TextOrNull(scan.patient_id)},
          {"purpose", NameIn(kPurposes, scan.purpose)},
          {"elapsed_s", scan.elapsed_s},
          {"coverage", OrNull(scan.coverage)},
          {"guidance", NameIn(kGuidance, scan.guidance)},
          {"keyframes", scan.keyframes},
          {"frames", scan.frames},
          {"frames_tracked", scan.frames_tracked},
          {"frames_dropped", scan.frames_dropped},
          {"step", scan.step},
          {"step_fraction", scan.step_fraction}};
}

bool DeeperThan(const nlohmann::json& json, int depth) {
  if (!json.is_structured()) return false;
  if (depth == 0) return true;
  return std::any_of(json.begin(), json.end(),
                     [&](const nlohmann::json& child) { return DeeperThan(child, depth - 1); });
}

nlohmann::json ParseShallow(const std::string& body) {
  // Counted before parsing: the parser's own tree must not become deep.
  int depth = 0, deepest = 0;
  for (const char c : body) {
    depth += c == '[' || c == '{' ? 1 : c == ']' || c == '}' ? -1 : 0;
    deepest = std::max(deepest, depth);
  }
  if (deepest > 64) return nlohmann::json::value_t::discarded;
  return nlohmann::json::parse(body, nullptr, /*allow_exceptions=*/false);
}

std::vector<double> ReadPoint(const nlohmann::json& item, const char* name, std::size_t width) {
  const bool valid =
      item.is_array() && item.size() == width &&
      std::all_of(item.begin(), item.end(), [](const nlohmann::json& value) {
        return value.is_number() && std::abs(value.get<double>()) <= kMaxCoordinate_m;
      });
  if (!valid)
    throw DataError(
        fmt::format("a point of {} must be {} numbers within {} m", name, width, kMaxCoordinate_m));
  return item.get<std::vector<double>>();
}

}  // namespace

std::string Dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string TimeText(WallClock::time_point time) {
  return fmt::format(
      "{:%Y-%m-%dT%H:%M:%SZ}",
      fmt::gmtime(WallClock::to_time_t(std::chrono::floor<std::chrono::seconds>(time))));
}

std::string_view Name(ApplianceState state) { return NameIn(kStates, state); }
std::string_view Name(ScanPurpose purpose) { return NameIn(kPurposes, purpose); }

namespace {

Json WordsJson(const std::array<std::string, 6>& words) {
  static constexpr std::array<const char*, 6> kNames = {"vertical", "longitudinal", "lateral",
                                                        "pitch",    "roll",         "yaw"};
  Json json = Json::object();
  for (std::size_t i = 0; i < words.size(); ++i) json[kNames[i]] = TextOrNull(words[i]);
  return json;
}

}  // namespace

Json ToJson(const Scan& scan, WallClock::time_point now) {
  Json json = {{"id", scan.id},
               {"patient_id", TextOrNull(scan.patient_id)},
               {"reference_id", TextOrNull(scan.reference_id)},
               {"purpose", NameIn(kPurposes, scan.purpose)},
               {"outcome", NameIn(kOutcomes, scan.outcome)},
               {"failure", TextOrNull(scan.failure)},
               {"started_at", TimeText(scan.started_at)},
               {"finished_at", nullptr},
               {"age_s", nullptr},
               {"accepted_by", TextOrNull(scan.accepted_by)},
               {"accepted_reason", TextOrNull(scan.accepted_reason)},
               {"session_id", TextOrNull(scan.session_id)},
               {"fraction", scan.fraction > 0 ? Json(scan.fraction) : Json(nullptr)},
               {"sensor_on_s", OrNull(scan.sensor_on_s)},
               {"check_overdue", scan.check_overdue},
               {"result", nullptr}};
  if (scan.finished_at) {
    json["finished_at"] = TimeText(*scan.finished_at);
    // An end in the future: the clock has stepped, and nobody knows the age.
    if (scan.age_s)
      json["age_s"] = static_cast<std::int64_t>(*scan.age_s);
    else if (now >= *scan.finished_at)
      json["age_s"] =
          std::chrono::duration_cast<std::chrono::seconds>(now - *scan.finished_at).count();
  }
  if (scan.result) {
    json["result"] = {
        {"verdict", scan.result->verdict},
        {"reasons", scan.result->reasons},
        {"correction", NumbersJson(scan.result->correction)},
        {"u95", NumbersJson(scan.result->u95)},
        {"words", WordsJson(scan.result->words)},
        {"body", {{"now", scan.result->body_now}, {"after", scan.result->body_after}}}};
  }
  return json;
}

namespace {

Json CheckJson(const CheckRecord& check, WallClock::time_point now) {
  Json items = Json::array();
  for (const CheckItem& item : check.items) {
    items.push_back(Json{{"name", item.name},
                         {"value", item.value ? Json(*item.value) : Json(nullptr)},
                         {"limit", item.limit},
                         {"unit", item.unit},
                         {"passed", item.passed},
                         {"note", TextOrNull(item.note)}});
  }
  return {
      {"id", check.id},
      {"time", TimeText(check.time)},
      {"age_s", std::max<std::int64_t>(
                    0, std::chrono::duration_cast<std::chrono::seconds>(now - check.time).count())},
      {"user", check.user},
      {"sensor_serial", check.sensor_serial},
      {"status", check.status},
      {"reasons", check.reasons},
      {"items", items},
      {"num_markers", check.num_markers}};
}

}  // namespace

Json ToJson(const CheckStatus& checks, WallClock::time_point now) {
  Json json = {{"checks", Json::array()}, {"baseline", nullptr}, {"overdue", checks.overdue}};
  for (const CheckRecord& check : checks.checks) json["checks"].push_back(CheckJson(check, now));
  if (checks.baseline) {
    json["baseline"] = {{"check_id", checks.baseline->check_id},
                        {"set_at", TimeText(checks.baseline->set_at)},
                        {"set_by", checks.baseline->set_by},
                        {"num_markers", checks.baseline->num_markers}};
  }
  return json;
}

namespace {

Json SessionJson(const TreatmentSession& session) {
  return {{"id", session.id},
          {"patient_id", session.patient_id},
          {"patient_code", session.patient_code},
          {"purpose", NameIn(kPurposes, session.purpose)},
          {"fraction", session.fraction > 0 ? Json(session.fraction) : Json(nullptr)},
          {"num_scans", session.num_scans},
          {"opened_by", session.opened_by},
          {"opened_at", TimeText(session.opened_at)}};
}

Json WaitingJson(const std::vector<WaitingReference>& waiting) {
  Json list = Json::array();
  for (const WaitingReference& reference : waiting) {
    list.push_back(Json{{"reference_id", reference.reference_id},
                        {"patient_id", reference.patient_id},
                        {"patient_code", reference.patient_code},
                        {"version", reference.version}});
  }
  return list;
}

}  // namespace

Json ToJson(const Status& status, WallClock::time_point now) {
  return {{"state", NameIn(kStates, status.state)},
          {"fault", TextOrNull(status.fault)},
          {"fault_kind", NameIn(kFaultKinds, status.fault_kind)},
          {"sensor",
           {{"present", status.sensor.present},
            {"serial", status.sensor.serial},
            {"name", status.sensor.name},
            {"fps", status.sensor.frames_per_second},
            {"powered_s", status.sensor.powered_s}}},
          {"storage",
           {{"free_bytes", status.storage.free_bytes},
            {"total_bytes", status.storage.total_bytes},
            {"writable", status.storage.writable},
            {"warnings", status.storage.warnings}}},
          {"light", status.light},
          {"patient_id", TextOrNull(status.patient_id)},
          {"next_purpose", NameIn(kPurposes, status.next_purpose)},
          {"scans_today", status.scans_today},
          {"session", status.session ? SessionJson(*status.session) : Json(nullptr)},
          {"room",
           {{"gantry_xy", status.gantry_xy},
            {"right_xy", status.right_xy},
            {"known", status.is_room_known}}},
          {"waiting", WaitingJson(status.waiting)},
          {"scan", status.scan ? LiveScanJson(*status.scan) : Json(nullptr)},
          {"check_overdue", status.check_overdue},
          {"reference_block", TextOrNull(status.reference_block)},
          {"last_check", status.last_check ? CheckJson(*status.last_check, now) : Json(nullptr)},
          {"last_result", status.last_result ? ToJson(*status.last_result, now) : Json(nullptr)},
          {"time", TimeText(now)},
          {"version", status.version},
          {"warnings", status.warnings},
          {"rolled_back", TextOrNull(status.rolled_back)}};
}

Json ToJson(const PlanTemplate& wanted) {
  return {{"site", wanted.site},
          {"width_mm", wanted.width_mm},
          {"height_mm", wanted.height_mm},
          {"tolerance", ToleranceJson(wanted.tolerance)},
          {"changed_by", wanted.changed_by}};
}

Json ToJson(const Patient& patient) {
  return {{"id", patient.id},
          {"code", patient.code},
          {"site", patient.site},
          {"created_at", TimeText(patient.created_at)},
          {"approved_reference_id", TextOrNull(patient.approved_reference_id)},
          {"num_scans", patient.num_scans},
          {"draft_reference_id", TextOrNull(patient.draft_reference_id)},
          {"note", patient.note},
          {"archived", patient.archived}};
}

namespace {

Json PlanJson(const ReferencePlan& plan) {
  Json region = Json::array();
  for (const auto& [x, y] : plan.region_m) region.push_back({x, y});
  return {{"region_m", region},
          {"isocentre_m", OrNull(plan.isocentre_m)},
          {"tolerance", ToleranceJson(plan.tolerance)},
          {"posture", plan.posture},
          {"couch_markers", plan.couch_markers}};
}

}  // namespace

Json ToJson(const Reference& reference) {
  return {{"id", reference.id},
          {"patient_id", reference.patient_id},
          {"version", reference.version},
          {"scan_id", reference.scan_id},
          {"created_at", TimeText(reference.created_at)},
          {"created_by", reference.created_by},
          {"reason", reference.reason},
          {"revision", reference.revision},
          {"digest", reference.digest},
          {"planned_by", TextOrNull(reference.planned_by)},
          {"approved_by", TextOrNull(reference.approved_by)},
          {"approved_at",
           reference.approved_at ? Json(TimeText(*reference.approved_at)) : Json(nullptr)},
          {"plan", reference.unreadable.empty() ? PlanJson(reference.plan) : Json(nullptr)},
          {"unreadable", TextOrNull(reference.unreadable)}};
}

Json ToJson(const User& user) {
  return {{"name", user.name},
          {"role", Name(user.role)},
          {"disabled", user.disabled},
          {"created_at", TimeText(user.created_at)}};
}

Json ToJson(const AuditEntry& entry) {
  return {{"number", entry.number},   {"time", TimeText(entry.time)}, {"user", entry.user},
          {"address", entry.address}, {"action", entry.action},       {"subject", entry.subject},
          {"detail", entry.detail}};
}

Json ToJson(const Settings& settings) {
  return {{"shift_tolerance_mm", settings.tolerance.shift_mm},
          {"rotation_tolerance_deg", settings.tolerance.rotation_deg},
          {"posture", settings.posture},
          {"couch_markers", settings.couch_markers},
          {"auto_stop_s", settings.auto_stop_s},
          {"scan_limit_s", settings.scan_limit_s},
          {"keep_recordings", settings.keep_recordings},
          {"retention_days", settings.retention_days},
          {"idle_logout_min", settings.idle_logout_min}};
}

Json ToJson(const UpdateStatus& update) {
  return {{"supported", update.supported},
          {"message", update.message},
          {"slot", update.slot},
          {"installing", update.installing},
          {"fraction", update.fraction},
          {"bundles", update.bundles},
          {"restart_needed", update.restart_needed},
          {"failure", TextOrNull(update.failure)},
          {"rolled_back", TextOrNull(update.rolled_back)}};
}

Fields::Fields(const std::string& body) : json_(ParseShallow(body)) {
  if (!json_.is_object() || DeeperThan(json_, kMaxDepth))
    throw DataError("expected a JSON object as the body");
}

const nlohmann::json& Fields::Get(const char* name) {
  known_.insert(name);
  const auto found = json_.find(name);
  if (found == json_.end()) throw DataError(fmt::format("{} is missing", name));
  return *found;
}

bool Fields::Has(const char* name) {
  known_.insert(name);
  return json_.contains(name);
}

std::string Fields::Text(const char* name, std::size_t min, std::size_t max, bool allow_lines) {
  const nlohmann::json& value = Get(name);
  if (!value.is_string())
    throw DataError(fmt::format("{} must be text, found {}", name, value.type_name()));
  const auto& text = value.get_ref<const std::string&>();
  if (text.size() < min || text.size() > max) {
    throw DataError(
        fmt::format("{} must have {} to {} bytes, found {}", name, min, max, text.size()));
  }
  if (!IsPlainText(text, allow_lines))
    throw DataError(fmt::format("{} must be plain text without control characters", name));
  return text;
}

double Fields::Number(const char* name, double min, double max) {
  const nlohmann::json& value = Get(name);
  if (!value.is_number())
    throw DataError(fmt::format("{} must be a number, found {}", name, value.type_name()));
  const double number = value.get<double>();
  if (!(number >= min && number <= max))
    throw DataError(fmt::format("{} must be from {} to {}, found {}", name, min, max, number));
  return number;
}

int Fields::Integer(const char* name, int min, int max) {
  const double number = Number(name, min, max);
  if (number != std::floor(number))
    throw DataError(fmt::format("{} must be a whole number, found {}", name, number));
  return static_cast<int>(number);
}

bool Fields::Flag(const char* name) {
  const nlohmann::json& value = Get(name);
  if (!value.is_boolean())
    throw DataError(fmt::format("{} must be true or false, found {}", name, value.type_name()));
  return value.get<bool>();
}

std::vector<std::vector<double>> Fields::Points(const char* name, std::size_t width,
                                                std::size_t max) {
  const nlohmann::json& list = Get(name);
  if (!list.is_array() || list.size() > max)
    throw DataError(fmt::format("{} must be a list of at most {} points", name, max));
  std::vector<std::vector<double>> points;
  for (const nlohmann::json& item : list) points.push_back(ReadPoint(item, name, width));
  return points;
}

std::optional<std::vector<double>> Fields::Point(const char* name, std::size_t width) {
  const nlohmann::json& value = Get(name);
  if (value.is_null()) return std::nullopt;
  return ReadPoint(value, name, width);
}

void Fields::Finish() const {
  for (const auto& item : json_.items()) {
    if (!known_.contains(item.key()))
      throw DataError(
          fmt::format("unknown field in the body; known are: {}", fmt::join(known_, ", ")));
  }
}

PlanTemplate ParseTemplate(const std::string& body) {
  constexpr double kMin_mm = 20, kMax_mm = 3000;
  Fields fields(body);
  PlanTemplate wanted;
  wanted.site = fields.Text("site", 1, kMaxSite);
  wanted.width_mm = fields.Number("width_mm", kMin_mm, kMax_mm);
  wanted.height_mm = fields.Number("height_mm", kMin_mm, kMax_mm);
  wanted.tolerance.shift_mm = fields.Number("shift_tolerance_mm", 0.1, 50);
  wanted.tolerance.rotation_deg = fields.Number("rotation_tolerance_deg", 0.1, 20);
  fields.Finish();
  return wanted;
}

ScanPurpose ParsePurpose(const std::string& name) {
  for (std::size_t i = 0; i < kPurposes.size(); ++i) {
    if (kPurposes[i] == name) return static_cast<ScanPurpose>(i);
  }
  throw DataError(fmt::format("purpose must be one of {}", fmt::join(kPurposes, ", ")));
}

namespace {

std::string ParsePosture(Fields& fields) {
  std::string posture = fields.Text("posture", 3, 3);
  if (std::find(kPostures.begin(), kPostures.end(), posture) == kPostures.end()) {
    throw DataError(fmt::format("posture must be one of {}", fmt::join(kPostures, ", ")));
  }
  return posture;
}

}  // namespace

std::pair<ReferencePlan, int> ParsePlan(const std::string& body) {
  Fields fields(body);
  ReferencePlan plan;
  const int revision = fields.Integer("revision", 1, kMaxRevision);
  for (const auto& point : fields.Points("region_m", 2, kMaxRegionCorners))
    plan.region_m.push_back({point[0], point[1]});
  if (!plan.region_m.empty() && plan.region_m.size() < 3)
    throw DataError("region_m must have no corner or at least 3");
  if (const auto point = fields.Point("isocentre_m", 3))
    plan.isocentre_m = {(*point)[0], (*point)[1], (*point)[2]};
  plan.tolerance.shift_mm = fields.Number("shift_tolerance_mm", 0.1, 50);
  plan.tolerance.rotation_deg = fields.Number("rotation_tolerance_deg", 0.1, 20);
  plan.posture = ParsePosture(fields);
  plan.couch_markers = fields.Flag("couch_markers");
  fields.Finish();
  return {plan, revision};
}

Settings ParseSettings(const std::string& body) {
  Fields fields(body);
  Settings settings;
  settings.tolerance.shift_mm = fields.Number("shift_tolerance_mm", 0.1, 50);
  settings.tolerance.rotation_deg = fields.Number("rotation_tolerance_deg", 0.1, 20);
  settings.posture = ParsePosture(fields);
  settings.couch_markers = fields.Flag("couch_markers");
  settings.auto_stop_s = fields.Number("auto_stop_s", 1, 120);
  settings.scan_limit_s = fields.Number("scan_limit_s", 5, 600);
  settings.keep_recordings = fields.Flag("keep_recordings");
  settings.retention_days = fields.Integer("retention_days", 0, 36500);
  settings.idle_logout_min = fields.Integer("idle_logout_min", 1, 240);
  fields.Finish();
  return settings;
}

}  // namespace plumb::web
