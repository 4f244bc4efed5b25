// SPDX-License-Identifier: Apache-2.0
// Recovers a unit that has no shell, as one file on a USB stick or on the data partition says.
// Physical access to the unit is the authorisation.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>

#include "algo/base/message.hpp"
#include "daemon/files/age_recipients.hpp"

namespace plumb {

/// One of the two.
struct UnitRecovery {
  std::optional<int> lost_scans;   ///< This number of missing scans is lost for good.
  std::filesystem::path backup;    ///< To be restored.
  std::filesystem::path key_file;  ///< Of an encrypted backup of 0.2.0, for a unit without a key.
  std::filesystem::path identity;  ///< Of a backup that is encrypted for recipients.
};

/// How the unit's own backups are encrypted, by its configuration. If they are, a stick restores
/// encrypted ones only: those of 0.2.0 that `key_file` opens, and others with the identity of one
/// of the recipients.
struct UnitBackupKeys {
  AgeRecipients recipients = {};
  std::filesystem::path key_file = {};  ///< Empty: none.
};

/// Reads and checks the whole file. Paths in it are relative to its folder.
/// @throws DataError naming file, line, what was expected and found.
[[nodiscard]] UnitRecovery ReadUnitRecovery(const std::filesystem::path& file);

/// A plumbd in safe mode tries to open its store from time to time, and uses the folder meanwhile.
struct RecoveryWait {
  std::chrono::milliseconds longest = std::chrono::seconds(3);
  std::function<void(std::chrono::milliseconds)> sleep = {};  ///< Empty: the thread's sleep.
};

/// Carries it out for a state folder that no plumbd works with: in safe mode, none does. Nothing
/// that was stored is deleted or overwritten; the next start notes it in the audit log. As root,
/// permanently drops to the rights of the folder's owner, once the key is read.
/// @returns what was done.
/// @throws DataError if the folder is in use, or as RestoreOver(); IoError
Message RecoverUnit(const UnitRecovery& given, const std::filesystem::path& state,
                    const UnitBackupKeys& configured, const RecoveryWait& wait = {});

}  // namespace plumb
