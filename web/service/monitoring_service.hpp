// SPDX-License-Identifier: Apache-2.0
// Live monitoring and the records of its sessions.
#pragma once

#include <memory>
#include <string>

#include <nlohmann/json.hpp>

#include "web/model/account.hpp"
#include "web/model/change.hpp"
#include "web/model/monitoring.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class MonitoringService {
 public:
  virtual ~MonitoringService() = default;

  /// Also where none goes on.
  [[nodiscard]] virtual MonitorStatus GetMonitor() = 0;
  /// How much higher the body lies now than it was scanned, from above, in the encoding of
  /// ApplianceService::SweptSurface(): 32767 where a sensor should see it and does not. Twice a
  /// second a new one; null where none is newer than a second.
  [[nodiscard]] virtual std::shared_ptr<const std::string> MonitorMap() = 0;
  /// Begins or ends it: kConflict where it cannot.
  virtual void StartMonitor(const Actor& actor, Done done) = 0;
  virtual void StopMonitor(const Actor& actor, Done done) = 0;
  /// Signs the newest position against the reference: kConflict where a sweep has to confirm it,
  /// where it is not known now, and where the advice is out and no reason is given.
  virtual void AcceptLive(const Actor& actor, const std::string& reason, Done done) = 0;
  /// The breath of the last second becomes the level of a breath hold: kConflict where it was not
  /// settled.
  virtual void TeachBreath(const Actor& actor, Done done) = 0;
  virtual void ForgetBreath(const Actor& actor, Done done) = 0;
  /// (background) Of a scan, oldest first: number and head of each, or why it cannot be read.
  [[nodiscard]] virtual nlohmann::json MonitorRecords(const std::string& scan_id) = 0;
  /// (background) What one says in short (daemon/monitoring_files/monitoring_file.hpp); null if
  /// there is none. One that cannot be read has a fault only.
  [[nodiscard]] virtual nlohmann::ordered_json MonitorReport(const std::string& scan_id,
                                                             int number) = 0;
  /// (background) Its frames as monitor.csv; empty if there is none, or it cannot be read.
  /// @param number  0: of the present or last session since the start, whatever its scan.
  [[nodiscard]] virtual std::string MonitorCsv(const std::string& scan_id, int number) = 0;
};

}  // namespace plumb::web
