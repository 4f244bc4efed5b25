// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/page_seals.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <string>
#include <vector>

#include "daemon/database/database_errors.hpp"
#include "daemon/scan_files/file_copy.hpp"
#include "drivers/files/descriptor.hpp"

namespace plumb {
namespace {

/// A checksum and its complement, which reveals damage. Zeros are no entry.
using SealEntry = std::array<std::uint64_t, 2>;

SealEntry EntryOf(std::uint64_t seal) { return {seal, ~seal}; }

off_t PlaceOf(std::uint32_t page) { return (off_t{page} - 1) * off_t{sizeof(SealEntry)}; }

std::string SealsOf(const std::filesystem::path& database) {
  return database.string() + kSealsSuffix;
}

}  // namespace

bool HasSeals(const std::filesystem::path& database) {
  return ::access(SealsOf(database).c_str(), F_OK) == 0;
}

void MakeSeals(const std::filesystem::path& database) {
  if (HasSeals(database)) return;
  const std::filesystem::path list = SealsOf(database);
  std::vector<SealEntry> entries;
  const Descriptor file(::open(database.c_str(), O_RDONLY | O_CLOEXEC));
  std::array<std::uint8_t, kPageBytes> page{};
  const auto next = [&] {
    return static_cast<std::int64_t>(entries.size()) * std::int64_t{kPageBytes};
  };
  while (file.get() >= 0 && ::pread(file.get(), page.data(), page.size(), next()) ==
                                static_cast<ssize_t>(page.size())) {
    const auto number = static_cast<std::uint32_t>(entries.size() + 1);
    entries.push_back(IsSealed(page, number) ? EntryOf(SealIn(page)) : SealEntry{});
  }
  const std::string bytes(reinterpret_cast<const char*>(entries.data()),
                          entries.size() * sizeof(SealEntry));
  try {
    PlaceFile(database.parent_path(), list.filename(), bytes);
  } catch (const IoError& error) {
    throw DiskRefused(error.message());
  }
}

int OpenSeals(const std::filesystem::path& database, bool writes) {
  return ::open(SealsOf(database).c_str(), (writes ? O_RDWR : O_RDONLY) | O_CLOEXEC);
}

bool NoteSeal(int seals, std::uint32_t page, std::uint64_t seal) {
  const SealEntry entry = EntryOf(seal);
  return ::pwrite(seals, entry.data(), sizeof(entry), PlaceOf(page)) ==
         static_cast<ssize_t>(sizeof(entry));
}

bool IsLastSeal(int seals, std::uint32_t page, std::uint64_t seal) {
  SealEntry entry{};
  if (::pread(seals, entry.data(), sizeof(entry), PlaceOf(page)) !=
          static_cast<ssize_t>(sizeof(entry)) ||
      entry[1] != ~entry[0])
    return true;
  return entry[0] == seal;
}

}  // namespace plumb
