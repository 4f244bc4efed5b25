// SPDX-License-Identifier: Apache-2.0
// Backs up a store that is in use, to a place where the backup lasts.
#pragma once

#include <filesystem>
#include <stop_token>
#include <string>

#include "daemon/archive/backup.hpp"
#include "daemon/records/store.hpp"

namespace plumb {

/// Why a backup that plumbd makes at `target` would be lost; empty if no reason is known. With
/// PrivateTmp=, systemd gives a service a /tmp that other processes cannot see and that is deleted
/// when the service stops; a file system in memory is empty after a reboot. Memory is accepted if
/// the state folder is in memory, too.
/// @param mounts  The text of /proc/self/mountinfo.
[[nodiscard]] Message WhyBackupIsLostAt(const std::filesystem::path& target,
                                        const std::filesystem::path& state,
                                        const std::string& mounts);

/// With the mounts of this process. @throws InvalidRequest with the reason
void RequireLastingPlace(const std::filesystem::path& target, const std::filesystem::path& state);

/// Thread-safe.
class StoreBackup {
 public:
  /// @param store  Borrowed; outlives this object.
  explicit StoreBackup(Store& store)
      : database_(store.database()), folders_(store.folders), gate_(store.gate()) {}

  /// While scans continue; nothing is removed meanwhile. See backup.hpp.
  /// @throws StoreRefusal if a backup is being made already; InvalidRequest for a target at
  ///         which it would be lost; IoError; Interrupted
  BackupReport Make(const Actor& actor, const std::filesystem::path& target,
                    const std::stop_token& stop = {}, const AgeRecipients& recipients = {});

 private:
  StoreDatabase& database_;
  const ScanFolders& folders_;
  RemovalGate& gate_;
};

}  // namespace plumb
