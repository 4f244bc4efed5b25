// SPDX-License-Identifier: Apache-2.0
// What a restore of a backup leaves in a state folder for the next start of a store.
#pragma once

#include <filesystem>

namespace plumb {

class Database;

/// In a state folder while RestoreOver() works: the backup as it was unpacked.
inline constexpr const char* kRestoringOver = ".recovery";
/// In a restored state folder, until its audit log has the entry.
inline constexpr const char* kRestored = "restored.json";
/// Scratch folders in the state folder, with copies of records while a backup is made.
inline constexpr const char* kBackingUp = ".backup";
inline constexpr const char* kRehearsing = ".rehearsal";

/// True after RestoreOver() was interrupted, such as by a power cut, after it had unpacked the
/// backup and before that was in place. It can be called again.
[[nodiscard]] bool IsRestoreInterrupted(const std::filesystem::path& state);

/// Adds the entry of a restore to the audit log, at the first start after it.
/// @throws IoError and its kinds
void NoteRestore(const std::filesystem::path& state, Database& database);

}  // namespace plumb
