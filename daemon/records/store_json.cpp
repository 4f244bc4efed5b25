#include "daemon/records/store_json.hpp"

#include <algorithm>
#include <functional>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "algo/acceptance/acceptance.hpp"
#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "web/model/limits.hpp"
#include "web/model/numbers.hpp"
#include "web/model/reference.hpp"
#include "web/model/scan.hpp"
#include "web/model/settings.hpp"

namespace plumb {
namespace {

using StoredJson = nlohmann::json;

[[noreturn]] void RefuseResult(const std::string& why) {
  throw DataError(fmt::format(
      "a stored result cannot be read: {}; the database was changed from outside, or its disk "
      "failed. Put a backup of the database in its place, or scan again",
      why));
}

// Results are read by the names with which the method writes them.
static_assert(std::ranges::equal(kNumberAxes, kNumberNames, std::equal_to<std::string_view>(),
                                 &NumberAxis::name));

/// Couch-fixed markers do not determine shifts; a missing angle is never treated as zero.
ReportedNumbers NumbersOf(const StoredJson& json) {
  ReportedNumbers numbers;
  for (const NumberAxis& axis : kNumberAxes) {
    const auto found = json.find(axis.key);
    if (axis.is_shift() && (found == json.end() || found->is_null())) continue;
    if (found == json.end() || !found->is_number())
      RefuseResult(fmt::format("{} is not a number", axis.key));
    numbers.*axis.member = found->get<double>();
  }
  return numbers;
}

/// An object; nothing if it is missing or null.
const StoredJson* ObjectIn(const StoredJson& json, const char* key) {
  const auto found = json.find(key);
  if (found == json.end() || found->is_null()) return nullptr;
  if (!found->is_object()) RefuseResult(fmt::format("{} is not an object", key));
  return &*found;
}

Verdict VerdictIn(const StoredJson& json) {
  const auto found = json.find("verdict");
  if (found != json.end() && found->is_string()) {
    if (const auto verdict = Named<Verdict>(found->get_ref<const std::string&>())) return *verdict;
  }
  RefuseResult("it has no verdict that this version knows");
}

void ReadWords(const StoredJson& result, ResultSummary& summary) {
  const auto text = [](const StoredJson& json, const char* key) {
    const auto found = json.find(key);
    return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  if (const auto words = result.value(StoredJson::json_pointer("/correction/words"), StoredJson());
      words.is_object()) {
    for (std::size_t i = 0; i < summary.words.size(); ++i)
      summary.words[i] = text(words, kNumberAxes[i].name);
  }
  const auto parts = result.value(StoredJson::json_pointer("/body/parts"), StoredJson());
  for (const StoredJson& part : parts.is_array() ? parts : StoredJson::array()) {
    if (!part.is_object()) continue;
    if (std::string words = text(part, "words_now"); !words.empty())
      summary.body_now.push_back(std::move(words));
    if (std::string words = text(part, "words_after"); !words.empty())
      summary.body_after.push_back(std::move(words));
    if (std::string words = text(part, "words_shift"); !words.empty())
      summary.body_after.push_back(std::move(words));
  }
}

/// A stored object whose values are read one by one and checked.
class Stored {
 public:
  Stored(const std::string& text, const char* what)
      : json_(ParseBoundedJsonOrNothing(text)), what_(what) {
    if (!json_.is_object()) Fail("expected a JSON object, found none");
  }

  [[noreturn]] void Fail(const std::string& why) const {
    throw DataError(
        fmt::format("{} cannot be read: {}; it was changed from outside, or its disk "
                    "failed. Put a backup of the database in its place, or save it again",
                    what_, why));
  }
  [[nodiscard]] const StoredJson* Find(const char* key) const {
    const auto found = json_.find(key);
    return found == json_.end() ? nullptr : &*found;
  }
  [[nodiscard]] double Number(const char* key, Range range) const {
    const StoredJson* value = Find(key);
    if (value == nullptr || !value->is_number()) Fail(fmt::format("{} is not a number", key));
    return InRange(key, value->get<double>(), range);
  }
  [[nodiscard]] Tolerance ReadTolerance() const {
    return {.shift_mm = Number("shift_tolerance_mm", kShiftTolerance_mm.stored),
            .rotation_deg = Number("rotation_tolerance_deg", kRotationTolerance_deg.stored)};
  }
  [[nodiscard]] bool Flag(const char* key) const {
    const StoredJson* value = Find(key);
    if (value == nullptr || !value->is_boolean()) Fail(fmt::format("{} is not true or false", key));
    return value->get<bool>();
  }
  [[nodiscard]] std::string Posture(const char* key) const {
    const StoredJson* value = Find(key);
    for (const std::string_view posture : kPostures) {
      if (value != nullptr && *value == posture) return std::string(posture);
    }
    Fail(fmt::format("{} is none of {}", key, fmt::join(kPostures, ", ")));
  }
  /// A point of finite numbers.
  template <std::size_t kSize>
  [[nodiscard]] std::array<double, kSize> Point(const char* key, const StoredJson& json) const {
    std::array<double, kSize> point{};
    if (!json.is_array() || json.size() != kSize)
      Fail(fmt::format("{} is not a point of {} numbers", key, kSize));
    for (std::size_t i = 0; i < kSize; ++i) {
      if (!json[i].is_number()) Fail(fmt::format("{} contains a value that is not a number", key));
      point[i] = InRange(key, json[i].get<double>(), {-kMaxCoordinate_m, kMaxCoordinate_m});
    }
    return point;
  }

 private:
  static constexpr double kMaxCoordinate_m = 1000.0;

  [[nodiscard]] double InRange(const char* key, double value, Range range) const {
    if (!range.Holds(value))
      Fail(fmt::format("{} is {}, expected {} to {}", key, value, range.least, range.most));
    return value;
  }

  StoredJson json_;
  const char* what_;
};

}  // namespace

std::string PlanJson(const ReferencePlan& plan) {
  StoredJson json = {{"region_m", plan.region_m},
                     {"shift_tolerance_mm", plan.tolerance.shift_mm},
                     {"rotation_tolerance_deg", plan.tolerance.rotation_deg},
                     {"posture", plan.posture},
                     {"couch_markers", plan.couch_markers}};
  if (plan.isocentre_m) json["isocentre_m"] = *plan.isocentre_m;
  return json.dump();
}

ReferencePlan ParsePlan(const std::string& text) {
  const Stored stored(text, "a stored plan");
  ReferencePlan plan;
  const StoredJson* region = stored.Find("region_m");
  if (region == nullptr || !region->is_array()) stored.Fail("region_m is not a list of points");
  for (const StoredJson& point : *region)
    plan.region_m.push_back(stored.Point<2>("region_m", point));
  if (plan.region_m.size() == 1 || plan.region_m.size() == 2)
    stored.Fail("region_m has fewer than 3 points");
  plan.tolerance = stored.ReadTolerance();
  plan.posture = stored.Posture("posture");
  plan.couch_markers = stored.Flag("couch_markers");
  if (const StoredJson* isocentre = stored.Find("isocentre_m"))
    plan.isocentre_m = stored.Point<3>("isocentre_m", *isocentre);
  return plan;
}

std::string SettingsJson(const Settings& settings) {
  return SettingsAs<StoredJson>(settings).dump();
}

std::string SettingsChanges(const std::string& stored, const Settings& settings) {
  const StoredJson before = ParseBoundedJsonOrNothing(stored);
  const StoredJson wanted = SettingsAs<StoredJson>(settings);
  StoredJson changes = StoredJson::object();
  for (const auto& [name, after] : wanted.items()) {
    if (!before.is_object() || !before.contains(name)) {
      changes[name] = StoredJson::array({after});
    } else if (before[name] != after) {
      changes[name] = StoredJson::array({before[name], after});
    }
  }
  return changes.dump();
}

Settings ParseSettings(const std::string& text) {
  const Stored stored(text, "the stored settings");
  Settings s;
  const auto number = [&](const char* key, double& value, const Limits& limits) {
    if (stored.Find(key) != nullptr) value = stored.Number(key, limits.stored);
  };
  const auto whole = [&](const char* key, int& value, const Limits& limits) {
    double read = value;
    number(key, read, limits);
    value = static_cast<int>(read);
  };
  s.tolerance = stored.ReadTolerance();
  s.posture = stored.Posture("posture");
  s.couch_markers = stored.Flag("couch_markers");
  number("auto_stop_s", s.auto_stop_s, kAutoStop_s);
  number("scan_limit_s", s.scan_limit_s, kScanLimit_s);
  if (stored.Find("keep_recordings") != nullptr) s.keep_recordings = stored.Flag("keep_recordings");
  whole("retention_days", s.retention_days, kRetention_days);
  whole("idle_logout_min", s.idle_logout_min, kIdleLogout_min);
  return s;
}

ResultSummary SummaryOf(const std::string& result_json) {
  const StoredJson json = ParseBoundedJsonOrNothing(result_json);
  if (!json.is_object()) RefuseResult("expected a JSON object, found none");
  ResultSummary summary{.verdict = VerdictIn(json)};
  ReadWords(json, summary);
  if (const auto reasons = json.find("reasons"); reasons != json.end()) {
    if (!reasons->is_array()) RefuseResult("its reasons are not a list");
    for (const StoredJson& reason : *reasons)
      summary.reasons.push_back(reason.is_string() ? reason.get<std::string>() : reason.dump());
  }
  if (const StoredJson* correction = ObjectIn(json, "correction")) {
    summary.correction = NumbersOf(*correction);
    if (const StoredJson* u95 = ObjectIn(*correction, "uncertainty")) summary.u95 = NumbersOf(*u95);
  }
  return summary;
}

}  // namespace plumb
