// Backs up a store that is in use, to a place where the backup lasts.
#pragma once

#include <filesystem>
#include <stop_token>
#include <string>

#include "daemon/records/backup.hpp"
#include "daemon/records/store_database.hpp"
#include "daemon/records/store_removal.hpp"

namespace plumb {

/// Why a backup that plumbd makes at `target` would be lost; empty if no reason is known. With
/// PrivateTmp=, systemd gives a service a /tmp that other processes cannot see and that is deleted
/// when the service stops; a file system in memory is empty after a reboot. Memory is accepted if
/// the state folder is in memory, too.
/// @param mounts  The text of /proc/self/mountinfo.
[[nodiscard]] std::string WhyBackupIsLostAt(const std::filesystem::path& target,
                                            const std::filesystem::path& state,
                                            const std::string& mounts);

/// With the mounts of this process. @throws std::invalid_argument with the reason
void RequireLastingPlace(const std::filesystem::path& target, const std::filesystem::path& state);

/// Thread-safe.
class StoreBackup {
 public:
  /// All are borrowed and outlive this object.
  StoreBackup(StoreDatabase& database, const ScanFolders& folders, RemovalGate& gate)
      : database_(database), folders_(folders), gate_(gate) {}

  /// While scans continue; nothing is removed meanwhile. See backup.hpp.
  /// @throws StoreRefusal if a backup is being made already; std::invalid_argument for a target at
  ///         which it would be lost; IoError; Interrupted
  BackupReport Make(const Actor& actor, const std::filesystem::path& target,
                    const std::stop_token& stop = {}, const BackupSecret* secret = nullptr);

 private:
  StoreDatabase& database_;
  const ScanFolders& folders_;
  RemovalGate& gate_;
};

}  // namespace plumb
