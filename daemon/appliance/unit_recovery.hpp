// Recovery of a unit that nobody can log in to with a shell, by one file on a USB stick or on the
// data partition: whoever stands at the unit has the authority.
#pragma once

#include <chrono>
#include <filesystem>
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

/// Carries it out for a state folder that no plumbd works with: in safe mode, none does. Nothing
/// that was stored is deleted or overwritten; the next start notes it in the audit log. Root takes
/// the rights of the folder's owner, for good, once the key is read.
/// @param configured_key  Key file of the configuration; empty: none. If there is one, only backups
///                        that were encrypted with it are restored.
/// @param wait  For a plumbd in safe mode that just tries to open its store.
/// @returns what was done, as a sentence.
/// @throws DataError if the folder is in use, or as RestoreOver(); IoError
std::string RecoverUnit(const UnitRecovery& given, const std::filesystem::path& state,
                        const std::filesystem::path& configured_key,
                        std::chrono::milliseconds wait = std::chrono::seconds(3));

}  // namespace plumb
