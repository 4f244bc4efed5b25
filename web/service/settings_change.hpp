// A change of some of the settings.
#pragma once

#include <optional>
#include <string>

#include "web/service/service_types.hpp"

namespace plumb::web {

/// Settings that are not set keep their stored value, so that two people who change different ones
/// at the same time do not undo each other's change.
struct SettingsChange {
  std::optional<double> shift_mm, rotation_deg;
  std::optional<std::string> posture;
  std::optional<bool> couch_markers;
  std::optional<double> auto_stop_s, scan_limit_s;
  std::optional<bool> keep_recordings;
  std::optional<int> retention_days, idle_logout_min;

  SettingsChange() = default;
  /// Changes all of them.
  SettingsChange(const Settings& all) {  // NOLINT(google-explicit-constructor): it is a change, too
    Pair(*this, all, [](auto& change, const auto& value) { change = value; });
  }

  [[nodiscard]] bool is_empty() const { return CountSet() == 0; }
  /// Nothing of what is stored is kept, so it need not be readable.
  [[nodiscard]] bool is_complete() const {
    return CountSet() == SettingsChange(Settings{}).CountSet();
  }
  [[nodiscard]] Settings AppliedTo(Settings stored) const {
    Pair(*this, stored, [](const auto& change, auto& value) {
      if (change) value = *change;
    });
    return stored;
  }

 private:
  template <typename Change, typename Values, typename Visit>
  static void Pair(Change& change, Values&& settings, const Visit& visit) {
    visit(change.shift_mm, settings.tolerance.shift_mm);
    visit(change.rotation_deg, settings.tolerance.rotation_deg);
    visit(change.posture, settings.posture);
    visit(change.couch_markers, settings.couch_markers);
    visit(change.auto_stop_s, settings.auto_stop_s);
    visit(change.scan_limit_s, settings.scan_limit_s);
    visit(change.keep_recordings, settings.keep_recordings);
    visit(change.retention_days, settings.retention_days);
    visit(change.idle_logout_min, settings.idle_logout_min);
  }
  [[nodiscard]] int CountSet() const {
    int count = 0;
    Pair(*this, Settings{}, [&](const auto& change, const auto&) { count += change ? 1 : 0; });
    return count;
  }
};

}  // namespace plumb::web
