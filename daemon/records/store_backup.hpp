// Backs up a store that is in use.
#pragma once

#include <filesystem>
#include <stop_token>

#include "daemon/records/backup.hpp"
#include "daemon/records/store_database.hpp"
#include "daemon/records/store_removal.hpp"

namespace plumb {

/// Thread-safe.
class StoreBackup {
 public:
  /// All are borrowed and outlive this object.
  StoreBackup(StoreDatabase& database, const ScanFolders& folders, RemovalGate& gate)
      : database_(database), folders_(folders), gate_(gate) {}

  /// While scans continue; nothing is removed meanwhile. See backup.hpp.
  /// @throws StoreRefusal if a backup is being made already; std::invalid_argument for a target at
  ///         which it would be lost; IoError; Interrupted
  BackupReport Make(const web::Actor& actor, const std::filesystem::path& target,
                    const std::stop_token& stop = {}, const BackupSecret* secret = nullptr);

 private:
  StoreDatabase& database_;
  const ScanFolders& folders_;
  RemovalGate& gate_;
};

}  // namespace plumb
