// SPDX-License-Identifier: Apache-2.0
// Whether a reference may be scanned or approved now: the daily check of the room, and the sensor's
// temperature.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <optional>

#include "algo/base/message.hpp"
#include "daemon/config/config.hpp"
#include "daemon/storage/current_store.hpp"
#include "daemon/sweep/sensor_thread.hpp"
#include "web/model/check.hpp"
#include "web/model/scan.hpp"

namespace plumb {

/// Used on the loop's thread.
class ReferenceGate {
 public:
  /// The store is borrowed, and what `sensor` uses outlives this object.
  /// @param is_demo  The demo's references need neither.
  ReferenceGate(const CurrentStore& store, const Config& config, bool is_demo,
                std::function<SensorSnapshot()> sensor);
  /// For a configuration that was read again.
  void Configure(const Config& config) { warm_up_min_ = config.appliance.warm_up_min; }
  /// The sensor is on from now.
  void SensorReady() { sensor_since_ = std::chrono::steady_clock::now(); }

  /// Why no reference may be scanned or approved now, with the next step: the daily check is
  /// overdue or has failed, or the sensor is still warming up. Empty if it may.
  /// @param scan  The scan that is to be the reference. One taken before a check had passed must be
  ///         confirmed by a later check of the same day (CheckStore::ConfirmsScan), or repeated. It
  ///         must also be repeated if the first check after it failed.
  [[nodiscard]] Message WhyNot(const std::optional<Scan>& scan = {}) const;
  /// Time that the sensor must have been on before a reference scan; from any thread.
  [[nodiscard]] double warm_up_min() const { return warm_up_min_; }
  /// Not set without a sensor.
  [[nodiscard]] std::optional<double> SensorOn_s() const;
  [[nodiscard]] DailyCheck CheckToday() const;
  [[nodiscard]] CheckStatus Checks() const;

 private:
  [[nodiscard]] Message WhyCold(const std::optional<Scan>& scan) const;

  const CurrentStore& store_;
  const bool is_demo_;
  const std::function<SensorSnapshot()> sensor_;
  std::atomic<double> warm_up_min_;
  std::chrono::steady_clock::time_point sensor_since_;
};

}  // namespace plumb
