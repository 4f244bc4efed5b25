// SPDX-License-Identifier: Apache-2.0
// The store's list of its own backups: which scans each one holds, and whether its bytes are still
// those that were written. An encrypted backup cannot be opened here, but its digest can be
// compared. Scans are removed for their age or for room only if such a backup holds them.
#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>

#include "daemon/archive/backup.hpp"
#include "daemon/database/store_database.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {

/// Reads a backup that was made. @throws DataError if it cannot be read; Interrupted
[[nodiscard]] std::string DigestOfBackup(const std::filesystem::path& place,
                                         const std::stop_token& stop = {});
/// Notes a backup and its digest, in place of an earlier backup at the same place. It counts as not
/// yet verified. @throws IoError and its kinds
void NoteBackup(Database& database, const BackupReport& made, const std::string& sha256);

struct CheckedBackup {
  std::filesystem::path place;
  Message fault;  ///< Empty if it is as it was made.
};

/// Checks the backup whose last check is the oldest, if that was at least `at_least` ago, and notes
/// whether it is verified. Nothing if none is due. The store is not locked during the check.
/// @throws IoError and its kinds; Interrupted
std::optional<CheckedBackup> CheckNextBackup(StoreDatabase& database, std::chrono::hours at_least,
                                             const std::stop_token& stop = {});

/// How often a person is asked to open an encrypted backup with the private key, which the unit
/// does not have.
inline constexpr std::chrono::hours kVerifiedEvery{24 * 183};
/// Whether a person has noted no such verification for as long, as the log says. Before the first
/// one the time runs from the first encrypted backup. @throws IoError and its kinds
[[nodiscard]] bool IsVerificationDue(Database& database, WallClock::time_point now);

}  // namespace plumb
