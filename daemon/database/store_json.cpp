// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/store_json.hpp"

#include <algorithm>
#include <functional>
#include <iterator>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/verdict/gates.hpp"
#include "daemon/database/stored_values.hpp"
#include "daemon/result/axis_names.hpp"
#include "daemon/result/stored_result.hpp"
#include "web/model/limits.hpp"
#include "web/model/numbers.hpp"
#include "web/model/reference.hpp"
#include "web/model/scan.hpp"
#include "web/model/settings.hpp"
#include "words/result.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

using StoredJson = nlohmann::json;
// Numbers are listed in the order in which the method writes them.
static_assert(std::ranges::equal(kNumberAxes, kNumberNames, std::equal_to<std::string_view>(),
                                 &NumberAxis::name));

ReportedNumbers NumbersOf(const StoredNumbers& stored) {
  ReportedNumbers numbers;
  for (std::size_t i = 0; i < stored.size(); ++i) numbers.*kNumberAxes[i].member = stored[i];
  return numbers;
}

/// A stored object whose values are read one by one and checked.
class Stored {
 public:
  /// @param unreadable  What is said if it cannot be read, and why.
  Stored(const std::string& text, Message (*unreadable)(Message why))
      : json_(ParseBoundedJsonOrNothing<StoredJson>(text)), unreadable_(unreadable) {
    if (!json_.is_object()) Fail(say::store::NoJsonObject());
  }

  [[noreturn]] void Fail(Message why) const { throw DataError(unreadable_(std::move(why))); }
  [[nodiscard]] const StoredJson* Find(const char* key) const {
    const auto found = json_.find(key);
    return found == json_.end() ? nullptr : &*found;
  }
  [[nodiscard]] double Number(const char* key, Range range) const {
    const StoredJson* value = Find(key);
    if (value == nullptr || !value->is_number()) Fail(say::store::ValueNoNumber(key));
    return InRange(key, value->get<double>(), range);
  }
  [[nodiscard]] Tolerance ReadTolerance() const {
    return {.shift_mm = Number("shift_tolerance_mm", kShiftTolerance_mm.stored),
            .rotation_deg = Number("rotation_tolerance_deg", kRotationTolerance_deg.stored)};
  }
  [[nodiscard]] bool Flag(const char* key) const {
    const StoredJson* value = Find(key);
    if (value == nullptr || !value->is_boolean()) Fail(say::store::ValueNoFlag(key));
    return value->get<bool>();
  }
  [[nodiscard]] std::string Posture(const char* key) const {
    const StoredJson* value = Find(key);
    for (const std::string_view posture : kPostures) {
      if (value != nullptr && *value == posture) return std::string(posture);
    }
    Fail(say::store::ValueNoPosture(
        key, std::vector<std::string>(std::begin(kPostures), std::end(kPostures))));
  }
  [[nodiscard]] std::string AcceptLive(const char* key) const {
    const StoredJson* value = Find(key);
    if (value == nullptr || !value->is_string() || !IsAcceptLive(value->get<std::string>()))
      Fail(say::store::ValueNoAcceptLive(key));
    return value->get<std::string>();
  }
  [[nodiscard]] std::string Paper(const char* key) const {
    const StoredJson* value = Find(key);
    if (value == nullptr || !value->is_string() || !IsReportPaper(value->get<std::string>()))
      Fail(say::store::ValueNoPaper(key));
    return value->get<std::string>();
  }
  [[nodiscard]] std::string Text(const char* key) const {
    const StoredJson* value = Find(key);
    if (value == nullptr || !value->is_string()) Fail(say::store::ValueNoText(key));
    return value->get<std::string>();
  }
  /// A point of finite numbers.
  template <std::size_t kSize>
  [[nodiscard]] std::array<double, kSize> Point(const char* key, const StoredJson& json) const {
    std::array<double, kSize> point{};
    if (!json.is_array() || json.size() != kSize) Fail(say::store::ValueNoPoint(key, kSize));
    for (std::size_t i = 0; i < kSize; ++i) {
      if (!json[i].is_number()) Fail(say::store::ValuePointNoNumber(key));
      point[i] = InRange(key, json[i].get<double>(), {-kMaxCoordinate_m, kMaxCoordinate_m});
    }
    return point;
  }

 private:
  static constexpr double kMaxCoordinate_m = 1000.0;

  [[nodiscard]] double InRange(const char* key, double value, Range range) const {
    if (!range.Holds(value)) Fail(say::store::ValueOutOfRange(key, value, range.least, range.most));
    return value;
  }

  StoredJson json_;
  Message (*unreadable_)(Message why);
};

std::string ReversesKey(std::size_t number) {
  return std::string("reverses_") + kNumberAxes.at(number).name;
}

}  // namespace

std::string PlanJson(const ReferencePlan& plan) {
  StoredJson json = {{"region_m", plan.region_m},
                     {"shift_tolerance_mm", plan.tolerance.shift_mm},
                     {"rotation_tolerance_deg", plan.tolerance.rotation_deg},
                     {"posture", plan.posture},
                     {"couch_markers", plan.couch_markers}};
  if (plan.isocentre_m) json["isocentre_m"] = *plan.isocentre_m;
  // Only where they are stated: what was signed before keeps its digest.
  if (plan.clothing_mm != 0.0) json["clothing_mm"] = plan.clothing_mm;
  if (plan.ct_breathing_mm != 0.0) json["ct_breathing_mm"] = plan.ct_breathing_mm;
  return json.dump();
}

ReferencePlan ParsePlan(const std::string& text) {
  const Stored stored(text, say::store::StoredPlanUnreadable);
  ReferencePlan plan;
  const StoredJson* region = stored.Find("region_m");
  if (region == nullptr || !region->is_array()) stored.Fail(say::store::ValueNoPoints("region_m"));
  for (const StoredJson& point : *region)
    plan.region_m.push_back(stored.Point<2>("region_m", point));
  if (plan.region_m.size() == 1 || plan.region_m.size() == 2)
    stored.Fail(say::store::ValueFewPoints("region_m"));
  plan.tolerance = stored.ReadTolerance();
  plan.posture = stored.Posture("posture");
  plan.couch_markers = stored.Flag("couch_markers");
  if (const StoredJson* isocentre = stored.Find("isocentre_m"))
    plan.isocentre_m = stored.Point<3>("isocentre_m", *isocentre);
  for (const auto& [key, value] :
       {std::pair{"clothing_mm", &plan.clothing_mm}, {"ct_breathing_mm", &plan.ct_breathing_mm}})
    if (stored.Find(key) != nullptr) *value = stored.Number(key, kStatedSurface_mm.stored);
  return plan;
}

std::string SettingsJson(const Settings& settings) {
  return SettingsAs<StoredJson>(settings).dump();
}

std::string SettingsChanges(const std::string& stored, const Settings& settings) {
  const StoredJson before = ParseBoundedJsonOrNothing<StoredJson>(stored);
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
  const Stored stored(text, say::store::StoredSettingsUnreadable);
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
  if (stored.Find("scan_wristband") != nullptr) s.scan_wristband = stored.Flag("scan_wristband");
  if (stored.Find("code_check_character") != nullptr)
    s.code_check_character = stored.Flag("code_check_character");
  whole("retention_days", s.retention_days, kRetention_days);
  whole("idle_logout_min", s.idle_logout_min, kIdleLogout_min);
  if (stored.Find("accept_live") != nullptr) s.accept_live = stored.AcceptLive("accept_live");
  number("breath_window_mm", s.breath_window_mm, kBreathWindow_mm);
  if (stored.Find("paper") != nullptr) s.paper = stored.Paper("paper");
  return s;
}

std::string CouchJson(const CouchProfile& couch) {
  StoredJson json = {{"version", couch.version},       {"name", couch.name},
                     {"num_axes", couch.num_axes},     {"is_in_cm", couch.is_in_cm},
                     {"hides_rest", couch.hides_rest}, {"wraps", couch.wraps},
                     {"signed_by", couch.signed_by},   {"signed_at", ToStored(couch.signed_at)}};
  for (std::size_t i = 0; i < kNumberAxes.size(); ++i) json[ReversesKey(i)] = couch.reverses.at(i);
  return json.dump();
}

CouchProfile ParseCouch(const std::string& text) {
  const Stored stored(text, say::store::StoredCouchUnreadable);
  constexpr double kMaxNumber = 9e15;  // exact as a floating-point number
  CouchProfile couch;
  couch.version = static_cast<int>(stored.Number("version", {1, 1e9}));
  couch.name = stored.Text("name");
  couch.num_axes = static_cast<int>(stored.Number("num_axes", {3, 6}));
  if (!IsCouchAxes(couch.num_axes))
    stored.Fail(say::store::ValueOutOfRange("num_axes", couch.num_axes, 3, 6));
  couch.is_in_cm = stored.Flag("is_in_cm");
  couch.hides_rest = stored.Flag("hides_rest");
  if (stored.Find("wraps") != nullptr) couch.wraps = stored.Flag("wraps");
  couch.signed_by = stored.Text("signed_by");
  couch.signed_at =
      FromStored(static_cast<std::int64_t>(stored.Number("signed_at", {-kMaxNumber, kMaxNumber})));
  for (std::size_t i = 0; i < kNumberAxes.size(); ++i)
    couch.reverses.at(i) = stored.Flag(ReversesKey(i).c_str());
  return couch;
}

ResultSummary SummaryOf(const std::string& result_json) {
  const StoredResult stored = [&] {
    try {
      return ParseResult(result_json, "result.json");
    } catch (const DataError& error) {
      throw DataError(say::store::StoredResultUnreadable(error.message()));
    }
  }();
  ResultSummary summary{.verdict = stored.verdict,
                        .reasons = stored.reasons,
                        .tolerance = {.shift_mm = stored.limits.shift_tolerance_mm,
                                      .rotation_deg = stored.limits.rotation_tolerance_deg}};
  summary.axes = AxisNames(stored.body);
  if (const auto& correction = stored.correction) {
    summary.correction = NumbersOf(correction->value);
    summary.u95 = NumbersOf(correction->u95);
    summary.words = correction->words;
    summary.judgements = correction->judgements;
    summary.about = IsAboutMiddle(stored) ? say::result::AboutMiddle() : say::result::AtIsocentre();
  }
  if (!stored.body) return summary;
  const auto add = [](std::vector<Message>& list, const Message& words) {
    if (!words.empty()) list.push_back(words);
  };
  for (const StoredBodyPart& part : stored.body->parts) {
    add(summary.body_now, part.words_now);
    add(summary.body_after, part.words_after);
    add(summary.body_after, part.words_shift);
  }
  return summary;
}

}  // namespace plumb
