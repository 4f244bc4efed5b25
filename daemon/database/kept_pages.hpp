// SPDX-License-Identifier: Apache-2.0
// A cache of the pages of a database, or of its log of writes, that this process has read or
// written: the event loop reads rows and must not wait for a slow disk. Only one process may use
// the database, so the cached pages cannot go stale.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>

#include "daemon/database/sealed_pages.hpp"

namespace plumb {

/// Thread-safe.
class KeptPages {
 public:
  /// What is kept of one file, in bytes. More is read from the disk each time.
  static constexpr std::size_t kMost = std::size_t{64} << 20;

  /// Shared by all that have the same file open; forgotten with the last of them.
  static std::shared_ptr<KeptPages> Of(const std::string& file);

  /// @param offset  Of the page in its file. @return whether the page is kept
  [[nodiscard]] bool Get(std::int64_t offset, void* page) const;
  /// @param page  As it was verified or written.
  void Put(std::int64_t offset, const void* page);
  void Drop(std::int64_t offset);
  void DropFrom(std::int64_t offset);  ///< All from there on, as the file is cut.

 private:
  mutable std::mutex mutex_;
  std::unordered_map<std::int64_t, std::unique_ptr<std::array<std::uint8_t, kPageBytes>>> pages_;
};

}  // namespace plumb
