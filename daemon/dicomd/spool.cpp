// SPDX-License-Identifier: Apache-2.0
#include "daemon/dicomd/spool.hpp"

#include <sys/random.h>

#include <cstring>
#include <ctime>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostFiles = 20'000;
/// A file that is still hidden after this time belongs to a transfer that was broken off.
constexpr std::chrono::hours kUnfinished{1};

std::string NowUtc(const char* format) {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  return {text.data(), std::strftime(text.data(), text.size(), format, &utc)};
}

}  // namespace

Spool::Spool(fs::path folder, const SpoolLimits& limits)
    : folder_(std::move(folder)), limits_(limits) {
  if (!fs::is_directory(folder_)) throw IoError(DescribeWriteError(folder_, ENOENT));
}

void Spool::RemoveOld() const {
  std::error_code error;
  const auto now = fs::file_time_type::clock::now();
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_, error)) {
    const auto age = now - entry.last_write_time(error);
    if (error || !entry.is_regular_file(error)) continue;
    const bool is_part = entry.path().extension() == ".part";
    if (age > limits_.keep || (is_part && age > kUnfinished)) fs::remove(entry.path(), error);
  }
}

std::uint64_t Spool::Bytes() const {
  std::error_code error;
  std::uint64_t bytes = 0;
  std::size_t files = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_, error)) {
    const std::uintmax_t size = entry.file_size(error);
    if (!error) bytes += size;
    if (++files > 2 * kMostFiles) return limits_.most_bytes;
  }
  return bytes;
}

std::optional<fs::path> Spool::NewFile() const {
  if (Bytes() >= limits_.most_bytes) return std::nullopt;
  std::uint64_t chance = 0;
  if (::getrandom(&chance, sizeof chance, 0) != sizeof chance) return std::nullopt;
  return folder_ / fmt::format("{}-{:016x}.part", NowUtc("%Y%m%d-%H%M%S"), chance);
}

bool Spool::Keep(const fs::path& file, const SpoolNote& note) const {
  const fs::path visible = fs::path(file).replace_extension(".dcm");
  const fs::path note_file = fs::path(file).replace_extension(".json");
  try {
    SyncToDisk(file);
    const nlohmann::ordered_json json = {{"format", 1},
                                         {"received_at", NowUtc("%Y-%m-%dT%H:%M:%SZ")},
                                         {"calling_ae_title", note.calling_ae_title},
                                         {"address", note.address},
                                         {"class_uid", note.class_uid},
                                         {"instance_uid", note.instance_uid},
                                         {"bytes", fs::file_size(file)}};
    WriteWholeFile(note_file,
                   std::string_view(json.dump(-1, ' ', false,
                                              nlohmann::ordered_json::error_handler_t::replace)));
    SyncToDisk(note_file);
    fs::rename(file, visible);
    SyncToDisk(folder_);
    return true;
  } catch (const std::exception&) {
    std::error_code error;
    for (const fs::path& one : {file, note_file, visible}) fs::remove(one, error);
    return false;
  }
}

}  // namespace plumb
