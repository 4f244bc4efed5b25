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
  /// By the newest check since then that passed or failed. Checks of other units do not count, but
  /// a failed one of an unnamed unit does. A check that passed in the future counts for nothing.
  /// @param sensor_serial  Unit that was to be checked; empty: any.
  [[nodiscard]] web::DailyCheck StateSince(web::WallClock::time_point since,
                                           const std::string& sensor_serial = {});
  /// Whether a later check confirms that sensor and markers were correct at this scan: of the same
  /// unit, passed on the day of the scan and after it, with no failed check in between and against
  /// a baseline from before the scan.
  [[nodiscard]] bool ConfirmsScan(const std::string& scan_id);
  /// Whether the first check after this scan, of the same or of an unnamed unit, failed: nobody
  /// knows since when what it found was wrong.
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
