// SPDX-License-Identifier: Apache-2.0
// The store of the appliance: SQLite beside folders of files.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include <sys/types.h>

#include "daemon/database/audit_store.hpp"
#include "daemon/database/couch_store.hpp"
#include "daemon/database/store_refusal.hpp"
#include "daemon/records/account_store.hpp"
#include "daemon/records/check_store.hpp"
#include "daemon/records/file_integrity.hpp"
#include "daemon/records/patient_store.hpp"
#include "daemon/records/reference_store.hpp"
#include "daemon/records/room_store.hpp"
#include "daemon/records/scan_store.hpp"
#include "daemon/records/settings_store.hpp"
#include "daemon/records/store_recovery.hpp"
#include "daemon/records/store_retention.hpp"
#include "daemon/state_folder/store_lease.hpp"

namespace plumb {

/// Locks a folder for one store, against other processes and machines.
class FolderLock {
 public:
  FolderLock() = default;
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;
  /// @throws DatabaseBusy if another process has it; DiskRefused if it cannot be locked, or lies on
  ///         a disk that other machines share
  void Take(const std::filesystem::path& folder);
  /// To be called every few minutes.
  void Renew() { lease_.Renew(); }

 private:
  int fd_ = -1;
  StoreLease lease_;
};

/// Denies other accounts access to a state folder and what it holds, and the group write access: an
/// older version or another program may have given it. What belongs to another account stays as it
/// is. Examines all files only if the state folder or scans/ is open. @returns the number of
/// changed permissions.
int RestrictAccess(const std::filesystem::path& state);

/// Identifies a folder and its disk.
struct FolderPlace {
  dev_t disk = 0;
  ino_t inode = 0;
  bool operator==(const FolderPlace&) const = default;
};

struct StoreOptions {
  ExaminePath look = LookAt;
  /// Time during which a database held by another process is retried; a copying program releases
  /// it.
  std::chrono::milliseconds lock_wait = std::chrono::minutes(1);
  std::chrono::milliseconds busy_wait = std::chrono::seconds(5);  ///< For each of the retries.
  std::function<void(std::chrono::milliseconds)> sleep = {};      ///< Empty: the thread's sleep.
  /// Time for the database check at the start.
  std::chrono::milliseconds check_limit = std::chrono::seconds(20);
  Settings first_settings = {};  ///< In force until somebody saves settings.
};

/// Opens DIR/plumb.db and DIR/scans/ID/ and owns the services over them. Users of a record call its
/// service. Each change and its entry in the audit log are one transaction.
class Store {
 public:
  /// Opens or creates the store, checks and migrates the database, and recovers from a crash.
  /// @throws IoError and its kinds: DatabaseCorrupt, DiskRefused.
  explicit Store(const std::filesystem::path& folder, const StoreOptions& options = {});
  /// Opens what can be read of a store on a disk that cannot be written: nothing is checked,
  /// repaired or changed, and every change throws DiskRefused.
  /// @throws IoError and its kinds.
  [[nodiscard]] static std::unique_ptr<Store> OpenReadable(const std::filesystem::path& folder,
                                                           const Settings& first_settings = {});

  /// Tries to write beside the database and in the folder of the scans.
  /// @throws DiskRefused with the reason if that fails, unless the disk is only full.
  void CheckWritable();
  /// Why the folder of the scans is no longer the one that was opened: its disk has probably been
  /// unmounted, and what is written would be hidden once it is mounted again. Empty if it is the
  /// same.
  [[nodiscard]] Message WhyOtherScans();
  [[nodiscard]] const RecoveryReport& recovery() const { return recovery_; }
  /// For work on the rows of any table, such as the import of a patient.
  [[nodiscard]] StoreDatabase& database() { return database_; }
  /// Keeps removals and backups apart.
  [[nodiscard]] RemovalGate& gate() { return gate_; }

  const ScanFolders folders;

 private:
  struct ReadOnly {};
  Store(const std::filesystem::path& folder, const Settings& first_settings, ReadOnly);

  FolderLock lock_;
  RecoveryReport recovery_;
  StoreDatabase database_;
  RemovalGate gate_;
  std::mutex place_mutex_;
  FolderPlace scans_place_;  ///< Of the folder of the scans.

 public:
  // Declared after the members that they use.
  AuditStore audit{database_};
  SettingsStore settings;
  UserStore users{database_};
  DisplayStore displays{database_};
  PatientStore patients{database_};
  TemplateStore templates{database_};
  TreatmentStore treatments{database_};
  CheckStore checks{database_};
  RoomStore room{database_};
  CouchStore couch{database_};
  ScanStore scans{database_, folders};
  FileIntegrity integrity;
  ReferenceStore references{database_, integrity};
  StoreRemoval removal{database_, folders, scans, gate_};
};

}  // namespace plumb
