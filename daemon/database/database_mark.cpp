// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/database_mark.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <string>

namespace plumb {
namespace {

/// The contents of the file: the number and its complement, which reveals damage.
using StoredMark = std::array<std::uint32_t, 2>;

std::string MarkOf(const std::filesystem::path& database) {
  return database.string() + kMarkSuffix;
}

}  // namespace

std::optional<DatabaseMark> ReadMark(const std::filesystem::path& database) {
  const int fd = ::open(MarkOf(database).c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return std::nullopt;
  StoredMark stored{};
  const ssize_t got = ::read(fd, stored.data(), sizeof(stored));
  ::close(fd);
  if (got != sizeof(stored) || stored[1] != ~stored[0]) return std::nullopt;
  return DatabaseMark{.changes = stored[0]};
}

void WriteMark(const std::filesystem::path& database, const DatabaseMark& mark) {
  const std::string file = MarkOf(database);
  int fd = ::open(file.c_str(), O_WRONLY | O_CLOEXEC);
  if (fd < 0) {  // the first one: its name has to last, too
    fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0640);
    const int folder = ::open(database.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder >= 0) {
      (void)::fsync(folder);
      ::close(folder);
    }
  }
  if (fd < 0) return;
  const StoredMark stored = {mark.changes, ~mark.changes};
  // Less than a sector, in one call: it is never half written.
  [[maybe_unused]] const ssize_t written = ::pwrite(fd, stored.data(), sizeof(stored), 0);
  ::close(fd);
}

void SyncMark(const std::filesystem::path& database) {
  const int fd = ::open(MarkOf(database).c_str(), O_WRONLY | O_CLOEXEC);
  if (fd < 0) return;
  (void)::fdatasync(fd);
  ::close(fd);
}

}  // namespace plumb
