// Daily checks of the room's markers, and the baseline that they are compared with.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/records/check_json.hpp"
#include "daemon/records/store_database.hpp"
#include "web/service/service_types.hpp"

namespace plumb {

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class CheckStore {
 public:
  explicit CheckStore(StoreDatabase& database) : database_(database) {}

  /// Returns the id.
  std::string Add(const web::Actor& actor, const std::string& sensor_serial,
                  const TakenCheck& taken);
  [[nodiscard]] std::vector<web::CheckRecord> List(int limit);  ///< Newest first.
  [[nodiscard]] std::optional<web::CheckRecord> Last();
  /// State by the newest check since then that passed or failed. Checks of other sensors do not
  /// count, except that a failed check without a serial number counts for every sensor. A pass
  /// dated in the future is ignored.
  /// @param sensor_serial  Sensor that must have been checked; empty: any.
  [[nodiscard]] web::DailyCheck StateSince(web::WallClock::time_point since,
                                           const std::string& sensor_serial = {});
  /// Whether a later check confirms that sensor and markers were correct at this scan: of the same
  /// unit, passed on the day of the scan and after it, with no failed check in between and against
  /// a baseline from before the scan.
  [[nodiscard]] bool ConfirmsScan(const std::string& scan_id);
  /// Whether the first check after this scan failed, so that the markers may already have been out
  /// of place during it. Checks of other sensors do not count, except that a failed check without a
  /// serial number counts for every sensor.
  [[nodiscard]] bool RefutesScan(const std::string& scan_id);

  [[nodiscard]] std::optional<web::CheckBaseline> Baseline();
  /// The markers of the baseline; nothing without a baseline.
  /// @throws DataError if they cannot be read.
  [[nodiscard]] std::optional<MarkerBaseline> BaselineMarkers();
  void SetBaseline(const web::Actor& actor, const std::string& check_id);

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
