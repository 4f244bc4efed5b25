// SPDX-License-Identifier: Apache-2.0
// A note about the unit, kept outside its state folder, beside its backups. A state folder that was
// rolled back as a whole, for example to a snapshot, is consistent in itself: only a comparison
// with this note reveals it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "daemon/database/audit_store.hpp"
#include "daemon/database/database.hpp"

namespace plumb {

/// In the folder of the backups.
inline constexpr const char* kOutsideNote = "plumb-unit.json";

struct OutsideNote {
  std::int64_t last_scan = 0;    ///< The highest number that was given to a scan.
  std::vector<AuditHead> heads;  ///< Of the audit log at different times, the oldest first.
};

/// Nothing if there is no note. @throws DataError if it cannot be parsed; IoError
[[nodiscard]] std::optional<OutsideNote> ReadOutsideNote(const std::filesystem::path& folder);
/// Replaces the note as a whole or not at all. @throws IoError
void WriteOutsideNote(const std::filesystem::path& folder, const OutsideNote& note);

/// How many entries of the audit log that the note knows are missing from the database, although
/// the log mentions neither a restored backup nor a factory reset; 0: none.
[[nodiscard]] std::int64_t LostEntries(Database& database, const OutsideNote& note);

/// The note, brought up to date from the database. Heads that are no longer in its log are dropped,
/// and only the newest ones are kept.
[[nodiscard]] OutsideNote Renewed(Database& database, OutsideNote note);

}  // namespace plumb
