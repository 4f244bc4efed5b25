// SPDX-License-Identifier: Apache-2.0
// Daily checks of the room's markers, and the baseline that they are compared with.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/database/store_database.hpp"
#include "daemon/records/check_json.hpp"
#include "web/model/account.hpp"
#include "web/model/check.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class CheckStore {
 public:
  explicit CheckStore(StoreDatabase& database) : database_(database) {}

  /// Returns the id.
  std::string Add(const Actor& actor, const std::string& sensor_serial, const TakenCheck& taken);
  [[nodiscard]] std::vector<CheckRecord> List(int limit);  ///< Newest first.
  [[nodiscard]] std::optional<CheckRecord> Last();
  /// State by the newest check since then that passed or failed. Checks of other sensors do not
  /// count, except that a failed check without a serial number counts for every sensor. A pass
  /// dated in the future is ignored.
  /// @param sensor_serial  Sensor that must have been checked; empty: any.
  [[nodiscard]] DailyCheck StateSince(WallClock::time_point since,
                                      const std::string& sensor_serial = {});
  /// Whether a later check confirms that sensor and markers were correct at this scan: of the same
  /// unit, passed on the day of the scan and after it, with no failed check in between and against
  /// a baseline from before the scan.
  [[nodiscard]] bool ConfirmsScan(const std::string& scan_id);
  /// Whether the first check after this scan failed, so that the markers may already have been out
  /// of place during it. Checks of other sensors do not count, except that a failed check without a
  /// serial number counts for every sensor.
  [[nodiscard]] bool RefutesScan(const std::string& scan_id);

  [[nodiscard]] std::optional<CheckBaseline> Baseline();
  /// The markers of the baseline; nothing without a baseline.
  /// @throws DataError if they cannot be read.
  [[nodiscard]] std::optional<MarkerBaseline> BaselineMarkers();
  /// @param reason  A person's; it is logged with what becomes otherwise.
  void SetBaseline(const Actor& actor, const std::string& check_id, const std::string& reason);
  /// What would change if this check takes the place of the baseline; empty if there is none,
  /// or the check saw no markers.
  [[nodiscard]] std::vector<Message> ChangesBy(const std::string& check_id);

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
