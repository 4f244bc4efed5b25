// Recovers a unit that has no shell, as one file on a USB stick or on the data partition says.
// Physical access to the unit is the authorisation.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

namespace plumb {

/// One of the two.
struct UnitRecovery {
  std::optional<int> lost_scans;   ///< This number of missing scans is lost for good.
  std::filesystem::path backup;    ///< To be restored.
  std::filesystem::path key_file;  ///< Of an encrypted backup, for a unit without a configured key.
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
/// @param configured_key  Key file of the configuration; empty: none. If there is one, only backups
///                        that were encrypted with it are restored.
/// @returns what was done, as a sentence.
/// @throws DataError if the folder is in use, or as RestoreOver(); IoError
std::string RecoverUnit(const UnitRecovery& given, const std::filesystem::path& state,
                        const std::filesystem::path& configured_key, const RecoveryWait& wait = {});

}  // namespace plumb
