#include "daemon/appliance/reference_gate.hpp"

#include <utility>

#include <fmt/format.h>

#include "daemon/appliance/room_in_use.hpp"

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

std::string ReferenceGate::WhyNot(const std::optional<Scan>& scan) const {
  if (is_demo_ || store_ == nullptr) return {};
  const DailyCheck today = CheckToday();
  if (today == DailyCheck::kFailed) {
    return "the daily check has failed, and references need one that has passed since: open Daily "
           "check, find out why it failed, sweep over all markers of the room, then go on here";
  }
  if (today == DailyCheck::kOverdue) {
    return "the daily check is overdue, and references need one that has passed today: open Daily "
           "check, sweep over all markers of the room, then go on here";
  }
  const bool is_unconfirmed =
      scan && scan->daily_check != DailyCheck::kPassed && !store_->checks.ConfirmsScan(scan->id);
  if (is_unconfirmed && scan->daily_check == DailyCheck::kFailed) {
    return "this scan was taken after a failed daily check, and no check of the same day and "
           "sensor has confirmed it: scan the reference again";
  }
  if (is_unconfirmed) {
    return "this scan was taken while the daily check was overdue, and no check of the same day "
           "and sensor has confirmed it: scan the reference again";
  }
  if (scan && store_->checks.RefutesScan(scan->id)) {
    return "the first daily check after this scan failed, so the markers may already have been out "
           "of place during it: scan the reference again";
  }
  return WhyCold(scan);
}

/// Depth drifts while a sensor warms up: a reference would keep that error for a whole course.
std::string ReferenceGate::WhyCold(const std::optional<Scan>& scan) const {
  const std::optional<double> on_s = scan ? scan->sensor_on_s : SensorOn_s();
  if (!on_s || *on_s >= 60 * warm_up_min()) return {};
  if (scan) {
    return fmt::format(
        "the sensor was still warming up at this scan, and references need one that has been on "
        "for {:g} min: scan the reference again",
        warm_up_min());
  }
  return fmt::format(
      "the sensor is still warming up, and references need one that has been on for {:g} min: "
      "wait, then scan",
      warm_up_min());
}

CheckStatus ReferenceGate::Checks() const {
  constexpr int kShown = 60;
  return {.checks = store_->checks.List(kShown),
          .baseline = store_->checks.Baseline(),
          .today = CheckToday()};
}

}  // namespace plumb
