// SPDX-License-Identifier: Apache-2.0
// The settings, one by one, and a change of some of them.
#pragma once

#include <optional>
#include <string>

#include "web/model/change.hpp"
#include "web/model/limits.hpp"
#include "web/model/reference.hpp"

namespace plumb {

/// Within the limits of limits.hpp.
struct Settings {
  Tolerance tolerance;          ///< For new references.
  std::string posture = "HFS";  ///< For new references.
  bool couch_markers = false;   ///< For new references.
  double auto_stop_s = 10.0;    ///< Time without new coverage.
  double scan_limit_s = 60.0;
  bool keep_recordings = false;       ///< Keep the raw frames of scans, with colour.
  bool scan_wristband = false;        ///< Asked for before each sweep of a patient's session.
  bool code_check_character = false;  ///< New codes of patients must have one.
  int retention_days = 0;             ///< Older scans are removed; 0: never. References are kept.
  int idle_logout_min = 15;
  std::string accept_live{kBySweep};         ///< Or kBySignature.
  double breath_window_mm = 3.5;             ///< Of a breath hold.
  std::string paper{kReportPapers.front()};  ///< Of reports; one of kReportPapers.
};

/// Calls visit(name, change, value, limits) for each of them, or without limits where it has none.
/// The names are those of the interface, of the store and of the log.
/// @param change  SettingsChange.
/// @param values  Settings.
template <typename Change, typename Values, typename Visit>
void ForEachSetting(Change& change, Values& values, const Visit& visit) {
  visit("shift_tolerance_mm", change.shift_mm, values.tolerance.shift_mm, kShiftTolerance_mm);
  visit("rotation_tolerance_deg", change.rotation_deg, values.tolerance.rotation_deg,
        kRotationTolerance_deg);
  visit("posture", change.posture, values.posture);
  visit("couch_markers", change.couch_markers, values.couch_markers);
  visit("auto_stop_s", change.auto_stop_s, values.auto_stop_s, kAutoStop_s);
  visit("scan_limit_s", change.scan_limit_s, values.scan_limit_s, kScanLimit_s);
  visit("keep_recordings", change.keep_recordings, values.keep_recordings);
  visit("scan_wristband", change.scan_wristband, values.scan_wristband);
  visit("code_check_character", change.code_check_character, values.code_check_character);
  visit("retention_days", change.retention_days, values.retention_days, kRetention_days);
  visit("idle_logout_min", change.idle_logout_min, values.idle_logout_min, kIdleLogout_min);
  visit("accept_live", change.accept_live, values.accept_live);
  visit("breath_window_mm", change.breath_window_mm, values.breath_window_mm, kBreathWindow_mm);
  visit("paper", change.paper, values.paper);
}

/// Settings that are not set keep their stored value, so that two people who change different ones
/// at the same time do not undo each other's change.
struct SettingsChange {
  std::optional<double> shift_mm, rotation_deg;
  std::optional<std::string> posture;
  std::optional<bool> couch_markers;
  std::optional<double> auto_stop_s, scan_limit_s;
  std::optional<bool> keep_recordings, scan_wristband, code_check_character;
  std::optional<int> retention_days, idle_logout_min;
  std::optional<std::string> accept_live;
  std::optional<double> breath_window_mm;
  std::optional<std::string> paper;

  SettingsChange() = default;
  /// Changes all of them.
  SettingsChange(const Settings& all) {  // NOLINT(google-explicit-constructor): it is a change, too
    ForEachSetting(*this, all, [](const char*, auto& change, const auto& value, const auto&...) {
      change = value;
    });
  }

  [[nodiscard]] bool is_empty() const { return CountSet() == 0; }
  /// Nothing of what is stored is kept, so it need not be readable.
  [[nodiscard]] bool is_complete() const {
    return CountSet() == SettingsChange(Settings{}).CountSet();
  }
  [[nodiscard]] Settings AppliedTo(Settings stored) const {
    ForEachSetting(*this, stored, [](const char*, const auto& change, auto& value, const auto&...) {
      if (change) value = *change;
    });
    return stored;
  }

 private:
  [[nodiscard]] int CountSet() const {
    int count = 0;
    const Settings any;
    ForEachSetting(*this, any, [&](const char*, const auto& change, const auto&...) {
      count += change ? 1 : 0;
    });
    return count;
  }
};

/// {"shift_tolerance_mm": 3.0, ...}
template <typename Json>
[[nodiscard]] Json SettingsAs(const Settings& settings) {
  Json json;
  const SettingsChange none;
  ForEachSetting(none, settings,
                 [&](const char* name, const auto&, const auto& value, const auto&...) {
                   json[name] = value;
                 });
  return json;
}

/// States what a factory reset keeps.
enum class FactoryReset { kKeepRecords, kWipe };

}  // namespace plumb
