// SPDX-License-Identifier: Apache-2.0
// Sensor profiles of the appliance: for which units they are kept, and what the page shows and
// changes.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "algo/base/message.hpp"
#include "daemon/config/config.hpp"
#include "daemon/scanning/unit_profile.hpp"
#include "daemon/sweep/sensor_thread.hpp"
#include "web/service/room_services.hpp"

namespace plumb {

/// Empty if the unit has none of its own: some sensors are known only by their port.
[[nodiscard]] std::string OwnSerial(const SensorDescription& sensor);

/// Call it from any thread, except for functions marked "on the loop".
class UnitProfiles {
 public:
  /// What `sensor` uses outlives this object.
  UnitProfiles(const Config& config, std::function<SensorSnapshot()> sensor);
  /// For a configuration that was read again; on the loop.
  void Configure(const Config& config);

  /// Empty if a profile is kept.
  [[nodiscard]] Message WhyNone(const SensorDescription& sensor) const;
  /// Of the connected unit, for the next scan; null if no profile is kept.
  [[nodiscard]] std::shared_ptr<UnitProfile> ForScan() const;
  [[nodiscard]] SensorProfiles OfConnected() const;
  [[nodiscard]] std::optional<std::string> FileOf(int version) const;
  /// Why the profile of that unit may not be changed; empty if it may while no scan runs.
  [[nodiscard]] Message WhyNotChange(const std::string& serial) const;
  [[nodiscard]] const std::shared_ptr<ProfileShelf>& shelf() const { return shelf_; }

  /// The sensor's contradiction of its profile in the last scan; empty: none. On the loop.
  [[nodiscard]] const Message& drift() const { return drift_; }
  void SetDrift(const Message& drift) { drift_ = drift; }

 private:
  const std::function<SensorSnapshot()> sensor_;
  const std::shared_ptr<ProfileShelf> shelf_;
  std::atomic<bool> is_off_ = false;
  Message drift_;
};

}  // namespace plumb
