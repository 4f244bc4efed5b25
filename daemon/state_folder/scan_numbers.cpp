// SPDX-License-Identifier: Apache-2.0
#include "daemon/state_folder/scan_numbers.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <system_error>

#include <fmt/format.h>

#include "algo/base/parse_number.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// The number in a folder's name such as "000012", "000012-interrupted" or ".staging-000012"; 0 if
/// there is none. Numbers of other lengths belong to no scan, and must not use up the numbers.
std::int64_t NumberIn(const std::string& name) {
  constexpr std::size_t kFewest = 6, kMost = 9;
  constexpr std::string_view kDigits = "0123456789";
  const std::size_t begin = std::min(name.find_first_of(kDigits), name.size());
  const std::size_t end = std::min(name.find_first_not_of(kDigits, begin), name.size());
  if (end - begin < kFewest || end - begin > kMost) return 0;
  return ParseNumber<std::int64_t>(std::string_view(name).substr(begin, end - begin)).value_or(0);
}

std::int64_t HighestIn(const fs::path& folder) {
  std::int64_t highest = 0;
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  for (const fs::directory_iterator end; !error && entry != end; entry.increment(error))
    highest = std::max(highest, NumberIn(entry->path().filename().string()));
  return highest;
}

constexpr std::size_t kNoteBytes = 10;  // nine digits and the end of the line

std::int64_t Noted(const fs::path& file) {
  std::array<char, kNoteBytes> text{};
  const int fd = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) return 0;
  const ssize_t got = ::read(fd, text.data(), text.size());
  ::close(fd);
  return got > 0 ? NumberIn(std::string(text.data(), static_cast<std::size_t>(got))) : 0;
}

}  // namespace

std::int64_t LastScanNumber(Database& database) {
  return database.FirstInteger("SELECT seq FROM sqlite_sequence WHERE name = 'scans'").value_or(0);
}

std::int64_t LastScanNumber(const ScanFolders& folders) {
  const fs::path& state = folders.state();
  std::int64_t highest = std::max(Noted(state / kLastScan), HighestIn(folders.scans()));
  for (const fs::path& aside : folders.SetAside()) highest = std::max(highest, HighestIn(aside));
  std::error_code error;
  fs::directory_iterator entry(state, error);
  for (const fs::directory_iterator end; !error && entry != end; entry.increment(error)) {
    if (entry->path().filename().string().starts_with("before-restore-"))
      highest = std::max(highest, HighestIn(entry->path() / kScansFolder));
  }
  return highest;
}

void NumberScansAbove(Database& database, std::int64_t number) {
  if (number <= LastScanNumber(database)) return;
  Transaction transaction(database);
  database.Run("UPDATE sqlite_sequence SET seq = ? WHERE name = 'scans'", number);
  if (database.num_changed() == 0)
    database.Run("INSERT INTO sqlite_sequence (name, seq) VALUES ('scans', ?)", number);
  transaction.Commit();
}

void NoteScanNumber(const fs::path& state, std::int64_t number) {
  const int fd = ::open((state / kLastScan).c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0640);
  if (fd < 0) return;
  const std::string text = fmt::format("{:09}\n", number);
  // In one call, and less than a sector: it is never half written.
  [[maybe_unused]] const ssize_t written = ::pwrite(fd, text.data(), text.size(), 0);
  ::close(fd);
}

}  // namespace plumb
