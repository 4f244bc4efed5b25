// SPDX-License-Identifier: Apache-2.0
// A file in the state folder that says who uses it. On a file system that is shared between
// machines, the same lock may be granted to everybody, and two programs that write to one database
// destroy it.
#pragma once

#include <filesystem>
#include <string>

#include "algo/base/message.hpp"

namespace plumb {

/// In the state folder, while it is in use.
inline constexpr const char* kLeaseFile = "plumb.db-lease";

/// A process on a machine since the machine's start.
struct LeaseHolder {
  std::string host;     ///< The machine's name, for people.
  std::string machine;  ///< Of /etc/machine-id.
  std::string boot;     ///< Changes with each start of the machine.
  long process = 0;
  bool operator==(const LeaseHolder&) const = default;
};
[[nodiscard]] LeaseHolder ThisProcess();

/// Why a file system of this kind (statfs()) cannot hold a store; empty if it can. A store needs a
/// disk that belongs to one machine.
[[nodiscard]] Message WhyNoPlaceForStore(const std::filesystem::path& folder, unsigned long kind);

/// Taken while the folder is locked, renewed while it is used, removed on destruction. If the file
/// cannot be written, as on a read-only disk, there is no lease. Not thread-safe.
class StoreLease {
 public:
  StoreLease() = default;
  ~StoreLease();
  StoreLease(const StoreLease&) = delete;
  StoreLease& operator=(const StoreLease&) = delete;
  /// @throws DatabaseBusy if another machine has used the folder within the last ten minutes
  void Take(const std::filesystem::path& folder);
  /// To be called every few minutes at least.
  void Renew();

 private:
  std::filesystem::path file_;
};

}  // namespace plumb
