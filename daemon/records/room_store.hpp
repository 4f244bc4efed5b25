// SPDX-License-Identifier: Apache-2.0
// The signed calibrations of the room, and the next one.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/database/store_database.hpp"
#include "daemon/records/room_calibration.hpp"

namespace plumb {

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class RoomStore {
 public:
  explicit RoomStore(StoreDatabase& database) : database_(database) {}

  /// Uses the check scans with this sensor since the given time and since the last signature.
  [[nodiscard]] RoomCandidate Candidate(const std::string& sensor_serial,
                                        WallClock::time_point since);
  /// @throws DataError for one that cannot be read.
  [[nodiscard]] std::optional<SignedRoom> Newest();
  /// Newest first, without unreadable ones.
  [[nodiscard]] std::vector<SignedRoom> List(int limit);
  /// @param digest  Digest of the candidate that was read; kConflict if another one would be
  ///         stored. Returns the version.
  std::string Sign(const Actor& actor, const std::string& sensor_serial,
                   WallClock::time_point since, const std::string& digest);
  /// Why a new calibration is due, by the newest check since the signature that saw enough of the
  /// room; empty if it is not due.
  [[nodiscard]] Message WhyDue(const SignedRoom& room, const MarkerCheckLimits& limits);

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
