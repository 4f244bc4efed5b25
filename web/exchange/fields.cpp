// SPDX-License-Identifier: Apache-2.0
// Reads the fields of requests from browsers.
#include <algorithm>
#include <cmath>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/names.hpp"
#include "algo/base/plain_text.hpp"
#include "algo/base/polygon.hpp"
#include "web/exchange/json.hpp"
#include "web/http/checks.hpp"
#include "web/model/couch.hpp"
#include "web/model/limits.hpp"
#include "web/model/patient.hpp"
#include "web/model/reference.hpp"
#include "web/model/scan.hpp"
#include "web/model/settings.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

constexpr int kMaxDepth = 8;
constexpr double kMaxCoordinate_m = 100.0;
constexpr std::size_t kMaxRegionCorners = 500;

std::vector<double> ReadPoint(const nlohmann::json& item, const char* name, std::size_t width) {
  const bool valid =
      item.is_array() && item.size() == width &&
      std::all_of(item.begin(), item.end(), [](const nlohmann::json& value) {
        return value.is_number() && std::abs(value.get<double>()) <= kMaxCoordinate_m;
      });
  if (!valid)
    throw DataError(say::web::FieldPoint(name, static_cast<std::int64_t>(width), kMaxCoordinate_m));
  return item.get<std::vector<double>>();
}

}  // namespace

Fields::Fields(const std::string& body) : json_(ParseBoundedJsonOrNothing(body, kMaxDepth)) {
  if (!json_.is_object()) throw DataError(say::web::ExpectedObject());
}

const nlohmann::json& Fields::Get(const char* name) {
  known_.insert(name);
  const auto found = json_.find(name);
  if (found == json_.end()) throw DataError(say::web::FieldMissing(name));
  return *found;
}

bool Fields::Has(const char* name) {
  known_.insert(name);
  return json_.contains(name);
}

std::string Fields::Text(const char* name, std::size_t min, std::size_t max, bool allow_lines) {
  const nlohmann::json& value = Get(name);
  if (!value.is_string()) throw DataError(say::web::FieldText(name, value.type_name()));
  const auto& text = value.get_ref<const std::string&>();
  if (text.size() < min || text.size() > max) {
    throw DataError(say::web::FieldLength(name, static_cast<std::int64_t>(min),
                                          static_cast<std::int64_t>(max),
                                          static_cast<std::int64_t>(text.size())));
  }
  if (!IsPlainText(text, allow_lines)) throw DataError(say::web::FieldPlainText(name));
  return text;
}

double Fields::Number(const char* name, double min, double max) {
  const nlohmann::json& value = Get(name);
  if (!value.is_number()) throw DataError(say::web::FieldNumber(name, value.type_name()));
  const double number = value.get<double>();
  if (!(number >= min && number <= max))
    throw DataError(say::web::FieldRange(name, min, max, number));
  return number;
}

int Fields::Integer(const char* name, int min, int max) {
  const double number = Number(name, min, max);
  if (number != std::floor(number)) throw DataError(say::web::FieldWhole(name, number));
  return static_cast<int>(number);
}

bool Fields::Flag(const char* name) {
  const nlohmann::json& value = Get(name);
  if (!value.is_boolean()) throw DataError(say::web::FieldFlag(name, value.type_name()));
  return value.get<bool>();
}

std::vector<std::vector<double>> Fields::Points(const char* name, std::size_t width,
                                                std::size_t max) {
  const nlohmann::json& list = Get(name);
  if (!list.is_array() || list.size() > max)
    throw DataError(say::web::FieldPoints(name, static_cast<std::int64_t>(max)));
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
      throw DataError(say::web::FieldUnknown({known_.begin(), known_.end()}));
  }
}

namespace {

double NumberIn(Fields& fields, const char* name, const Limits& limits) {
  return fields.Number(name, limits.entered.least, limits.entered.most);
}
Tolerance ToleranceIn(Fields& fields) {
  return {.shift_mm = NumberIn(fields, "shift_tolerance_mm", kShiftTolerance_mm),
          .rotation_deg = NumberIn(fields, "rotation_tolerance_deg", kRotationTolerance_deg)};
}
std::string PostureIn(Fields& fields) {
  std::string posture = fields.Text("posture", 3, 3);
  if (!IsPosture(posture))
    throw DataError(say::web::FieldPosture({kPostures.begin(), kPostures.end()}));
  return posture;
}

void Take(Fields& fields, const char* name, std::optional<double>& wanted, const Limits& limits) {
  wanted = NumberIn(fields, name, limits);
}
void Take(Fields& fields, const char* name, std::optional<int>& wanted, const Limits& limits) {
  wanted = fields.Integer(name, static_cast<int>(limits.entered.least),
                          static_cast<int>(limits.entered.most));
}
void Take(Fields& fields, const char* name, std::optional<bool>& wanted) {
  wanted = fields.Flag(name);
}
void Take(Fields& fields, const char* name, std::optional<std::string>& wanted) {
  if (std::string_view(name) == "posture") {
    wanted = PostureIn(fields);
    return;
  }
  wanted = fields.Text(name, 1, 16);
  if (std::string_view(name) == "paper") {
    if (!IsReportPaper(*wanted)) throw DataError(say::web::FieldPaper());
    return;
  }
  if (!IsAcceptLive(*wanted)) throw DataError(say::web::FieldAcceptLive());
}

}  // namespace

PlanTemplate ParseTemplate(const std::string& body) {
  constexpr double kMin_mm = 20, kMax_mm = 3000;
  Fields fields(body);
  PlanTemplate wanted;
  wanted.site = fields.Text("site", 1, kMaxSite);
  wanted.width_mm = fields.Number("width_mm", kMin_mm, kMax_mm);
  wanted.height_mm = fields.Number("height_mm", kMin_mm, kMax_mm);
  wanted.tolerance = ToleranceIn(fields);
  if (fields.Has("posture")) wanted.posture = PostureIn(fields);
  if (fields.Has("hint")) wanted.hint = fields.Text("hint", 0, kMaxReason);
  fields.Finish();
  return wanted;
}

CouchProfile ReadCouch(Fields& fields) {
  CouchProfile couch;
  couch.version = fields.Integer("version", 0, 999'999'999);
  couch.name = fields.Text("name", 1, kMaxName);
  couch.num_axes = fields.Integer("num_axes", 3, 6);
  if (!IsCouchAxes(couch.num_axes)) throw DataError(say::web::FieldCouchAxes());
  couch.is_in_cm = fields.Flag("is_in_cm");
  couch.hides_rest = fields.Flag("hides_rest");
  if (fields.Has("wraps")) couch.wraps = fields.Flag("wraps");
  for (std::size_t i = 0; i < kNumberAxes.size(); ++i)
    couch.reverses.at(i) = fields.Flag((std::string("reverses_") + kNumberAxes.at(i).name).c_str());
  return couch;
}

ScanPurpose ParsePurpose(const std::string& name) {
  if (const auto purpose = Named<ScanPurpose>(name)) return *purpose;
  throw DataError(
      say::web::FieldPurpose({kNamesOf<ScanPurpose>.begin(), kNamesOf<ScanPurpose>.end()}));
}

std::pair<ReferencePlan, int> ParsePlan(const std::string& body) {
  Fields fields(body);
  ReferencePlan plan;
  const int revision = fields.Integer("revision", 1, kMaxRevision);
  for (const auto& point : fields.Points("region_m", 2, kMaxRegionCorners))
    plan.region_m.push_back({point[0], point[1]});
  if (!plan.region_m.empty() && plan.region_m.size() < 3) throw DataError(say::web::FieldRegion());
  std::vector<Eigen::Vector2d> corners;
  for (const auto& corner : plan.region_m) corners.emplace_back(corner[0], corner[1]);
  if (CrossingEdges(corners)) throw DataError(say::web::FieldRegionCrosses());
  if (const auto point = fields.Point("isocentre_m", 3))
    plan.isocentre_m = {(*point)[0], (*point)[1], (*point)[2]};
  plan.tolerance = ToleranceIn(fields);
  plan.posture = PostureIn(fields);
  plan.couch_markers = fields.Flag("couch_markers");
  for (const auto& [name, stated] :
       {std::pair{"clothing_mm", &plan.clothing_mm}, {"ct_breathing_mm", &plan.ct_breathing_mm}})
    if (fields.Has(name)) *stated = NumberIn(fields, name, kStatedSurface_mm);
  fields.Finish();
  return {plan, revision};
}

SettingsChange ParseSettingsChange(const std::string& body) {
  Fields fields(body);
  SettingsChange change;
  const Settings any;
  ForEachSetting(change, any,
                 [&](const char* name, auto& wanted, const auto&, const auto&... limits) {
                   if (fields.Has(name)) Take(fields, name, wanted, limits...);
                 });
  fields.Finish();
  if (change.is_empty()) throw DataError(say::web::NoSetting());
  return change;
}

}  // namespace plumb::web
