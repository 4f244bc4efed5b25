// SPDX-License-Identifier: Apache-2.0
// The one database of a store, shared by its services.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>

#include "algo/base/message.hpp"
#include "daemon/database/database.hpp"
#include "web/model/account.hpp"

namespace plumb {

/// Three connections to one file: one makes all changes, one reads single rows, one reads lists.
/// Reads never wait for the disk writes of a change, nor a row for a list. Thread-safe: a
/// connection is held by one thread at a time.
class StoreDatabase {
 public:
  /// A connection, held by the calling thread during the lifetime of this object.
  class Held {
   public:
    Database* operator->() const { return database_; }
    Database& operator*() const { return *database_; }

   private:
    friend class StoreDatabase;
    Held(std::mutex& mutex, Database& database) : lock_(mutex), database_(&database) {}
    std::unique_lock<std::mutex> lock_;
    Database* database_;
  };

  /// @param write    The connection for changes, with tables of this version and its digests.
  /// @param readers  How the two others open the same file.
  /// @throws IoError and its kinds
  StoreDatabase(std::unique_ptr<Database> write, const std::filesystem::path& file,
                Database::Access readers);

  [[nodiscard]] Held ForChanges() { return {write_mutex_, *write_}; }
  [[nodiscard]] Held ForRows() { return {row_mutex_, row_}; }  ///< Also for the event loop.
  [[nodiscard]] Held ForLists() { return {list_mutex_, list_}; }

 private:
  std::mutex write_mutex_;
  std::unique_ptr<Database> write_;
  std::mutex row_mutex_;
  Database row_;
  std::mutex list_mutex_;
  Database list_;
};

/// One change and its entries in the audit log, as one transaction. Rolled back unless Commit() is
/// called. Other changes wait until it ends.
class StoreChange {
 public:
  explicit StoreChange(StoreDatabase& database)
      : held_(database.ForChanges()), transaction_(*held_) {}

  Database* operator->() const { return &*held_; }
  Database& operator*() const { return *held_; }
  /// Adds an entry to the audit log.
  void Log(const Actor& actor, const std::string& action, const std::string& subject,
           const Message& detail);
  /// After a change that decides what the unit does, the log of writes is emptied into the
  /// database: what is in the log alone can be lost with it.
  void Commit();

 private:
  StoreDatabase::Held held_;
  Transaction transaction_;
  bool decides_ = false;
};

}  // namespace plumb
