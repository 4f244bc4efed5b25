// SPDX-License-Identifier: Apache-2.0
#include "daemon/update/channel.hpp"

#include <fcntl.h>
#include <sodium.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <cstdio>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/files/sha256.hpp"
#include "daemon/loop/give_way.hpp"
#include "daemon/network/transfer.hpp"
#include "daemon/update/bundle_check.hpp"
#include "daemon/update/channel_memory.hpp"
#include "drivers/files/descriptor.hpp"
#include "drivers/files/file_io.hpp"
#include "words/channel.hpp"
#include "words/update.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSchemes = "https,http";  // the configuration allows http on loopback only
constexpr std::string_view kPartEnd = ".part";
/// A download may be slow, but not as slow as somebody who wants to keep it open.
constexpr long kLeastBytesPerSecond = 1024, kSlowFor_s = 60;
constexpr std::chrono::hours kLongestDownload{12};

/// Text that is taken up to a limit.
struct BoundedText {
  std::string text;
  std::size_t most = 0;
};

std::size_t TakeText(char* from, std::size_t size, std::size_t count, void* into) {
  auto& bounded = *static_cast<BoundedText*>(into);
  if (bounded.text.size() + size * count > bounded.most) return 0;
  bounded.text.append(from, size * count);
  return size * count;
}

/// @throws DataError if it did not come as a whole
std::string Fetch(const ChannelOptions& options, const std::string& name, std::size_t most,
                  const std::stop_token& stop) {
  Transfer transfer(options.url + "/" + name, kSchemes, options.trusted, stop);
  BoundedText got{.text = {}, .most = most};
  transfer.Set(CURLOPT_WRITEFUNCTION, &TakeText);
  transfer.Set(CURLOPT_WRITEDATA, static_cast<void*>(&got));
  const std::string failed = transfer.Perform();
  if (!failed.empty()) throw DataError(say::channel::Unreachable(name, failed));
  if (transfer.status() != 200)
    throw DataError(say::channel::Unreachable(name, fmt::format("HTTP {}", transfer.status())));
  return std::move(got.text);
}

/// Where a download goes on.
struct OpenPart {
  const Descriptor& file;
  const std::filesystem::path& path;
  const ChannelOptions& options;
  std::uint64_t had = 0, most = 0, got = 0;
  SteadyFlush flush;
  Transfer* transfer = nullptr;
  Message failure = {};  ///< Of writing.
};

/// Only what continues the part is written: the page of an error is not. Scans that are made
/// meanwhile keep their room.
std::size_t TakePart(char* from, std::size_t size, std::size_t count, void* into) {
  auto& part = *static_cast<OpenPart*>(into);
  const std::size_t bytes = size * count;
  const long expected = part.had > 0 ? 206 : 200;
  if (part.transfer->status() != expected || part.had + part.got + bytes > part.most) return 0;
  try {
    CheckRoom(part.options.folder, part.most - part.had - part.got, part.options.free_bytes);
    WriteAll(part.file, {from, bytes}, part.path);
  } catch (const std::exception& error) {
    part.failure = MessageOf(error);
    return 0;
  }
  part.flush.Wrote(bytes);
  part.got += bytes;
  return bytes;
}

/// Parts of files that the index no longer names.
void RemoveOtherParts(const fs::path& folder, const fs::path& kept) {
  std::error_code error, ignored;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.starts_with(".channel-") && name.ends_with(kPartEnd) && entry->path() != kept)
      fs::remove(entry->path(), ignored);
  }
}

/// One attempt to get the rest of a part.
/// @throws DataError if it did not come as a whole
void FetchRest(const ChannelOptions& options, const ChannelBundle& bundle, const fs::path& path,
               const std::stop_token& stop) {
  const Descriptor file(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0640));
  const off_t end = file.get() < 0 ? -1 : ::lseek(file.get(), 0, SEEK_END);
  if (end < 0) throw IoError(DescribeWriteError(path, errno));
  const auto had = static_cast<std::uint64_t>(end);
  if (had >= bundle.bytes) return;
  CheckRoom(options.folder, bundle.bytes - had, options.free_bytes);
  Transfer transfer(options.url + "/" + bundle.name, kSchemes, options.trusted, stop);
  OpenPart part{.file = file,
                .path = path,
                .options = options,
                .had = had,
                .most = bundle.bytes,
                .flush = SteadyFlush(file, had),
                .transfer = &transfer};
  transfer.SetLimits(std::chrono::seconds(10), kLongestDownload);
  transfer.Set(CURLOPT_LOW_SPEED_LIMIT, kLeastBytesPerSecond);
  transfer.Set(CURLOPT_LOW_SPEED_TIME, kSlowFor_s);
  transfer.Set(CURLOPT_RESUME_FROM_LARGE, static_cast<curl_off_t>(had));
  transfer.Set(CURLOPT_WRITEFUNCTION, &TakePart);
  transfer.Set(CURLOPT_WRITEDATA, static_cast<void*>(&part));
  const std::string failed = transfer.Perform();
  SyncToDisk(path);
  if (!part.failure.empty()) throw DataError(part.failure);
  if (had + part.got == bundle.bytes) return;
  // A server that does not continue files: the next look begins again.
  if (had > 0 && part.got == 0 && transfer.status() == 200) (void)!::ftruncate(file.get(), 0);
  if (part.got == 0)
    throw DataError(say::channel::Unreachable(
        bundle.name, failed.empty() ? fmt::format("HTTP {}", transfer.status()) : failed));
  throw DataError(say::channel::Incomplete(bundle.name, static_cast<std::int64_t>(had + part.got),
                                           static_cast<std::int64_t>(bundle.bytes)));
}

/// A reason not to fetch a bundle.
enum class Found { kHere, kRemovedByPerson };

/// @throws DataError if another file has the name, IoError if it cannot be read
std::optional<Found> FindHere(const ChannelOptions& options, const ChannelMemory& memory,
                              const ChannelBundle& bundle, const std::stop_token& stop) {
  const fs::path target = options.folder / bundle.name;
  const std::optional<FileStamp> stamp = StampOf(target);
  std::error_code error;
  if (!stamp && fs::exists(fs::symlink_status(target, error)))
    throw DataError(say::channel::OtherFile(bundle.name));
  const auto is_remembered = [&](const FetchedBundle& one) {
    return one.name == bundle.name && (stamp ? one.stamp == stamp : one.sha256 == bundle.sha256);
  };
  const auto own = std::ranges::find_if(memory.fetched, is_remembered);
  if (own != memory.fetched.end()) {
    if (!stamp) return Found::kRemovedByPerson;
    if (own->sha256 == bundle.sha256) return Found::kHere;
    return std::nullopt;  // made again under its name
  }
  if (!stamp) return std::nullopt;
  if (stamp->bytes != bundle.bytes || SumOfFile(target, stop).sha256 != bundle.sha256)
    throw DataError(say::channel::OtherFile(bundle.name));
  return Found::kHere;
}

/// Those that this unit fetched before; one that a person removed or replaced stays in the memory.
void RemoveFetched(const ChannelOptions& options, ChannelMemory& memory) {
  const std::size_t removed = std::erase_if(memory.fetched, [&](const FetchedBundle& one) {
    const fs::path file = options.folder / one.name;
    std::error_code error;
    return StampOf(file) == one.stamp && fs::remove(file, error);
  });
  if (removed > 0) KeepChannelMemory(options.state, memory);
}

/// @throws DataError, IoError, Interrupted
void Download(const ChannelOptions& options, ChannelMemory& memory, const ChannelBundle& bundle,
              const std::stop_token& stop) {
  constexpr std::size_t kMostRemembered = 16;
  if (bundle.bytes > options.max_bytes)
    throw DataError(say::update::TooLarge(bundle.name, WholeMegabytes(bundle.bytes),
                                          WholeMegabytes(options.max_bytes)));
  std::error_code error;
  fs::create_directories(options.folder, error);
  RemoveFetched(options, memory);
  // Named by the contents: those of another index are not continued.
  const fs::path path = options.folder / fmt::format(".channel-{}{}", bundle.sha256, kPartEnd);
  RemoveOtherParts(options.folder, path);
  FetchRest(options, bundle, path, stop);
  if (SumOfFile(path, stop).sha256 != bundle.sha256) {
    fs::remove(path, error);
    throw DataError(say::channel::OtherContents(bundle.name));
  }
  const std::optional<FileStamp> stamp = StampOf(path);
  // A person may have put a file of this name there meanwhile.
  const fs::path target = options.folder / bundle.name;
  if (::renameat2(AT_FDCWD, path.c_str(), AT_FDCWD, target.c_str(), RENAME_NOREPLACE) != 0) {
    if (errno == EEXIST) throw DataError(say::channel::OtherFile(bundle.name));
    throw IoError(DescribeWriteError(target, errno));
  }
  SyncToDisk(options.folder);
  memory.fetched.push_back({.name = bundle.name, .sha256 = bundle.sha256, .stamp = stamp.value()});
  if (memory.fetched.size() > kMostRemembered) memory.fetched.erase(memory.fetched.begin());
  KeepChannelMemory(options.state, memory);
}

/// @throws DataError, IoError, Interrupted
ChannelLook LookNow(const ChannelOptions& options, const std::stop_token& stop) {
  ChannelMemory memory = ReadChannelMemory(options.state);
  std::int64_t& seen = memory.newest[NameOfOrder(options.channel, options.key)];
  const std::string text = Fetch(options, "index.json", kMaxIndexBytes, stop);
  const std::string signature = Fetch(options, "index.sig", crypto_sign_BYTES, stop);
  const ChannelIndex index = ReadChannelIndex(text, signature, options.key, options.channel, seen);
  if (index.number > seen) {
    seen = index.number;
    KeepChannelMemory(options.state, memory);
  }
  const std::optional<ChannelBundle> offered = OfferedTo(index, options.serial, options.version);
  if (!offered) return {};
  const std::optional<Found> found = FindHere(options, memory, *offered, stop);
  if (found == Found::kRemovedByPerson) return {};
  if (!found) {
    if (options.may_fetch && !options.may_fetch()) {
      ChannelLook postponed;
      postponed.is_postponed = true;
      return postponed;
    }
    Download(options, memory, *offered, stop);
  }
  return {.name = offered->name,
          .version = offered->version,
          .failure = {},
          .is_new = !found.has_value()};
}

}  // namespace

ChannelLook LookAtChannel(const ChannelOptions& options, const std::stop_token& stop) {
  try {
    return LookNow(options, stop);
  } catch (const std::exception& error) {
    return {.name = {}, .version = {}, .failure = MessageOf(error)};
  }
}

void RemoveChannelParts(const fs::path& folder) { RemoveOtherParts(folder, {}); }

ChannelWatch::ChannelWatch(ChannelOptions options, std::function<void(const ChannelLook&)> looked)
    : options_(std::move(options)),
      looked_(std::move(looked)),
      thread_([this](const std::stop_token& stop) {
        GiveWayToScans();
        ChannelLook last;
        std::mutex mutex;
        std::condition_variable_any stopped;
        std::unique_lock lock(mutex);
        for (auto pause = options_.first_after;;) {
          stopped.wait_for(lock, stop, pause, [] { return false; });
          if (stop.stop_requested()) return;
          ChannelLook look = LookAtChannel(options_, stop);
          if (stop.stop_requested()) return;
          const bool is_done = look.failure.empty() && !look.is_postponed;
          if (is_done) {
            last = look;
          } else {
            look.name = last.name;
            look.version = last.version;
          }
          looked_(look);
          pause = is_done ? options_.every : options_.again_after;
        }
      }) {}

}  // namespace plumb
