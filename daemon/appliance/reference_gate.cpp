// SPDX-License-Identifier: Apache-2.0
#include "daemon/appliance/reference_gate.hpp"

#include <utility>

#include "daemon/appliance/room_in_use.hpp"
#include "words/scan.hpp"

namespace plumb {

ReferenceGate::ReferenceGate(const CurrentStore& store, const Config& config, bool is_demo,
                             std::function<SensorSnapshot()> sensor)
    : store_(store),
      is_demo_(is_demo),
      sensor_(std::move(sensor)),
      warm_up_min_(config.appliance.warm_up_min) {}

std::optional<double> ReferenceGate::SensorOn_s() const {
  const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - sensor_since_;
  return sensor_().present ? std::optional(passed.count()) : std::nullopt;
}

DailyCheck ReferenceGate::CheckToday() const {
  return store_->checks.StateSince(StartOfDay(), sensor_().sensor.serial);
}

Message ReferenceGate::WhyNot(const std::optional<Scan>& scan) const {
  if (is_demo_ || store_ == nullptr) return {};
  const DailyCheck today = CheckToday();
  if (today == DailyCheck::kFailed) {
    return say::scan::CheckFailed();
  }
  if (today == DailyCheck::kOverdue) {
    return say::scan::CheckOverdue();
  }
  const bool is_unconfirmed =
      scan && scan->daily_check != DailyCheck::kPassed && !store_->checks.ConfirmsScan(scan->id);
  if (is_unconfirmed && scan->daily_check == DailyCheck::kFailed) {
    return say::scan::ScannedAfterFailedCheck();
  }
  if (is_unconfirmed) {
    return say::scan::ScannedWhileOverdue();
  }
  if (scan && store_->checks.RefutesScan(scan->id)) {
    return say::scan::RefutedByCheck();
  }
  return WhyCold(scan);
}

/// Depth drifts while a sensor warms up: a reference would keep that error for a whole course.
Message ReferenceGate::WhyCold(const std::optional<Scan>& scan) const {
  const std::optional<double> on_s = scan ? scan->sensor_on_s : SensorOn_s();
  if (!on_s || *on_s >= 60 * warm_up_min()) return {};
  return scan ? say::scan::WasWarmingUp(warm_up_min()) : say::scan::IsWarmingUp(warm_up_min());
}

CheckStatus ReferenceGate::Checks() const {
  constexpr int kShown = 60;
  CheckStatus status{.checks = store_->checks.List(kShown),
                     .baseline = store_->checks.Baseline(),
                     .today = CheckToday()};
  if (!status.checks.empty()) status.changes = store_->checks.ChangesBy(status.checks.front().id);
  return status;
}

}  // namespace plumb
