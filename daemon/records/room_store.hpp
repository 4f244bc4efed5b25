// The room's calibrations that were signed, and the next one.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/records/room_calibration.hpp"
#include "daemon/records/store_database.hpp"

namespace plumb {

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class RoomStore {
 public:
  explicit RoomStore(StoreDatabase& database) : database_(database) {}

  /// Of the check scans with this sensor since then and since the last signature.
  [[nodiscard]] RoomCandidate Candidate(const std::string& sensor_serial,
                                        web::WallClock::time_point since);
  /// @throws DataError for one that cannot be read.
  [[nodiscard]] std::optional<SignedRoom> Newest();
  /// Newest first, those that cannot be read left out.
  [[nodiscard]] std::vector<SignedRoom> List(int limit);
  /// @param digest  Of the candidate that was read; kConflict where it is not what would be stored.
  /// Gives the version.
  std::string Sign(const web::Actor& actor, const std::string& sensor_serial,
                   web::WallClock::time_point since, const std::string& digest);
  /// By the newest check since it was signed that saw enough of the room; empty: it is not due.
  [[nodiscard]] std::string WhyDue(const SignedRoom& room, const MarkerCheckLimits& limits);

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
