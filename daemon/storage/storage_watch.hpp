// SPDX-License-Identifier: Apache-2.0
// What is stored, and whether it can be used: opening it, safe mode while it cannot be used, and
// the room on its disks.
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <system_error>
#include <vector>

#include "algo/base/message.hpp"
#include "daemon/loop/event_loop.hpp"
#include "daemon/loop/work_thread.hpp"
#include "daemon/storage/current_store.hpp"

namespace plumb {

struct StorageOptions {
  std::filesystem::path state = {};
  /// Why the configuration cannot be used; empty if it can. If it cannot, nothing stored is
  /// touched, because the configured folder may be another.
  Message configuration_fault = {};
  Settings first_settings = {};  ///< In force until somebody saves settings.
  /// Longest check of the whole database at the start. A larger one is checked while the appliance
  /// already works.
  std::chrono::milliseconds check_limit = StoreOptions().check_limit;
  /// Pauses between the attempts to leave safe mode; the last one is repeated.
  std::vector<std::chrono::milliseconds> retries = {
      std::chrono::seconds(10), std::chrono::seconds(60), std::chrono::seconds(300)};
  /// Measures the room on the disk of a folder. Empty: asks the system.
  std::function<std::filesystem::space_info(const std::filesystem::path&, std::error_code&)> space =
      {};
  /// Whether a time server has set the wall clock. Empty: as IsClockKept() has it.
  std::function<bool()> is_clock_kept = {};
};

/// The owner of the storage. Called on the loop's thread.
class StorageUser {
 public:
  virtual ~StorageUser() = default;
  /// The store can be changed from now on. @throws IoError and its kinds, if it cannot
  virtual void StoreOpened(Store& store) = 0;
  virtual void StorageFailed() = 0;
  virtual void StorageFaultChanged() = 0;
  virtual void StorageWorks() = 0;
  /// Reads everything that the status shows. @throws IoError and its kinds
  virtual void ReadAll() = 0;
  [[nodiscard]] virtual bool IsRunning() const = 0;
  [[nodiscard]] virtual bool HasSession() const = 0;
};

/// Used on the loop's thread, except for functions marked "from any thread".
class StorageWatch {
 public:
  /// Why nothing can be stored.
  enum class Fault {
    kMayEnd,  ///< For example, a disk is read-only or not mounted.
    kDamage,  ///< The database is damaged: somebody has to restore a backup and restart plumbd.
  };

  /// Everything is borrowed. The threads are destroyed before this object.
  /// @param changes  For changes of the store. @param reads  For what may take long.
  StorageWatch(EventLoop& loop, StorageOptions options, WorkThread& changes, WorkThread& reads);

  /// At the start; waits for a program that copies the database. The user is borrowed.
  void Open(StorageUser& user);
  /// In safe mode a read-only one, or none. From any thread.
  [[nodiscard]] const CurrentStore& store() const { return store_; }
  [[nodiscard]] const std::filesystem::path& state() const { return options_.state; }
  /// That the configuration cannot be used, which is no fault of the storage.
  [[nodiscard]] bool has_configuration_fault() const {
    return !options_.configuration_fault.empty();
  }
  /// Why nothing can be stored; empty outside safe mode.
  [[nodiscard]] const Message& fault() const { return fault_; }
  [[nodiscard]] bool IsUsable() const { return store_ != nullptr && fault_.empty(); }
  /// Attempts to leave safe mode that were armed since it began.
  [[nodiscard]] std::size_t num_retries() const { return num_retries_; }
  void Stop() { stopped_ = true; }

  /// Begins safe mode, except for a fault that is not worse than the present one.
  void Fail(const Message& what, Fault kind);
  /// The same after the present callback of the loop; from any thread.
  void FailLater(const std::exception& error);
  /// Checks whether the disk has become read-only, so that no patient is scanned for nothing.
  /// Called on the loop; the check itself runs on the store's thread.
  void CheckDisk();

  /// True also where nothing can be said of it.
  [[nodiscard]] bool IsReadOnly() const;
  /// Of the state folder's disk, or of the one that scans/ is: the one with less room.
  [[nodiscard]] std::optional<std::filesystem::space_info> SpaceForScans() const;
  /// From any thread.
  [[nodiscard]] std::filesystem::space_info SpaceOf(const std::filesystem::path& folder,
                                                    std::error_code& error) const;
  /// Used fraction of the disk with less room, counted as df does, without the blocks reserved for
  /// root. 0 if no disk can be examined.
  [[nodiscard]] double UsedFraction() const;
  [[nodiscard]] bool IsNearlyFull() const;
  /// From any thread.
  [[nodiscard]] bool IsClockKept() const;

 private:
  [[nodiscard]] std::unique_ptr<Store> OpenForWork(StoreOptions options) const;
  void Use(std::unique_ptr<Store> store);
  void EnterSafeMode(const Message& what, Fault kind);
  void ArmRetry();
  void Retry();
  void Probe();
  void Reopen();
  void EndRetry(const Message& what, Fault kind = Fault::kMayEnd);
  void LeaveSafeMode();
  void LogRecovery(const RecoveryReport& found) const;

  EventLoop& loop_;
  const StorageOptions options_;
  StorageUser* user_ = nullptr;  ///< Set once it is open.
  WorkThread& changes_;
  WorkThread& reads_;
  CurrentStore store_;
  bool is_open_ = false;  ///< For changes; otherwise it is read-only, or there is none.
  Message fault_;
  Fault kind_ = Fault::kMayEnd;
  std::size_t num_retries_ = 0;
  std::chrono::steady_clock::time_point works_since_;
  bool stopped_ = false;
  EventLoop::Source timer_;
};

}  // namespace plumb
