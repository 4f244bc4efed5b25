// SPDX-License-Identifier: Apache-2.0
#include "daemon/update/channel_memory.hpp"

#include <sys/stat.h>

#include <exception>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "daemon/files/sha256.hpp"
#include "daemon/scan_files/file_copy.hpp"
#include "daemon/update/bundle_check.hpp"
#include "drivers/files/file_io.hpp"
#include "words/channel.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr std::size_t kMaxMemoryBytes = 64 << 10;

FetchedBundle FetchedFrom(const Json& json) {
  FetchedBundle fetched{.name = json.at("name").get<std::string>(),
                        .sha256 = json.at("sha256").get<std::string>(),
                        .stamp = {.inode = json.at("inode").get<std::uint64_t>(),
                                  .bytes = json.at("bytes").get<std::uint64_t>(),
                                  .modified_ns = json.at("modified_ns").get<std::int64_t>()}};
  if (!IsBundleName(fetched.name)) throw DataError(Message::Verbatim("fetched.name"));
  return fetched;
}

}  // namespace

std::optional<FileStamp> StampOf(const fs::path& file) {
  struct stat found {};
  if (::lstat(file.c_str(), &found) != 0 || !S_ISREG(found.st_mode)) return std::nullopt;
  constexpr std::int64_t kNanoseconds = 1'000'000'000;
  return FileStamp{.inode = found.st_ino,
                   .bytes = static_cast<std::uint64_t>(found.st_size),
                   .modified_ns = found.st_mtim.tv_sec * kNanoseconds + found.st_mtim.tv_nsec};
}

std::string NameOfOrder(const std::string& channel, const std::string& key) {
  return fmt::format("{}-{}", channel, Sha256Of(key).substr(0, 8));
}

ChannelMemory ReadChannelMemory(const fs::path& state) {
  const fs::path file = state / kChannelMemoryFile;
  std::error_code error;
  if (fs::symlink_status(file, error).type() == fs::file_type::not_found) return {};
  try {
    const Json json = ParseBoundedJson(ReadTextFile(file, kMaxMemoryBytes));
    ChannelMemory memory{.newest = json.at("newest").get<std::map<std::string, std::int64_t>>()};
    for (const Json& one : json.at("fetched")) memory.fetched.push_back(FetchedFrom(one));
    return memory;
  } catch (const std::exception& unreadable) {
    throw DataError(say::channel::MemoryUnreadable(file.string(), MessageOf(unreadable)));
  }
}

void KeepChannelMemory(const fs::path& state, const ChannelMemory& memory) {
  Json fetched = Json::array();
  for (const FetchedBundle& one : memory.fetched)
    fetched.push_back({{"name", one.name},
                       {"sha256", one.sha256},
                       {"inode", one.stamp.inode},
                       {"bytes", one.stamp.bytes},
                       {"modified_ns", one.stamp.modified_ns}});
  PlaceFile(state, kChannelMemoryFile,
            Json{{"newest", memory.newest}, {"fetched", fetched}}.dump());
}

}  // namespace plumb
