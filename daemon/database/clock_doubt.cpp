// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/clock_doubt.hpp"

#include <cstdint>
#include <optional>
#include <string>

#include "daemon/database/stored_values.hpp"

namespace plumb {
namespace {

constexpr const char* kDoubted = "clock_doubted";  // in the table of settings

}  // namespace

void DoubtAfterLeap(Database& database, WallClock::time_point now) {
  const std::optional<std::int64_t> newest =
      database.FirstInteger("SELECT time FROM audit ORDER BY number DESC LIMIT 1");
  if (newest && now - FromStored(*newest) > kLeap) DoubtClock(database);
}

void DoubtClock(Database& database) {
  Transaction transaction(database);
  database.Run("INSERT OR REPLACE INTO settings (name, value) VALUES (?, ?)", kDoubted,
               std::to_string(StoredNow()));
  transaction.Commit();
}

bool IsClockDoubted(Database& database) {
  return database.Has("SELECT 1 FROM settings WHERE name = ?", kDoubted);
}

void TrustClock(Database& database) {
  database.Run("DELETE FROM settings WHERE name = ?", kDoubted);
}

}  // namespace plumb
