// SPDX-License-Identifier: Apache-2.0
#include "daemon/update/channel.hpp"

#include <fcntl.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/parse_number.hpp"
#include "daemon/network/transfer.hpp"
#include "drivers/files/descriptor.hpp"
#include "drivers/files/file_io.hpp"
#include "words/channel.hpp"

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

std::int64_t SeenNumber(const fs::path& file) {
  std::error_code error;
  if (!fs::exists(file, error)) return 0;
  std::string text = ReadTextFile(file, 64);
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return ParseNumber<std::int64_t>(text).value_or(0);
}

/// In one step: half a number would be a lower one.
void KeepNumber(const fs::path& file, std::int64_t number) {
  const fs::path next = file.string() + ".new";
  WriteWholeFile(next, fmt::format("{}\n", number));
  fs::rename(next, file);
}

/// Where a download goes on.
struct OpenPart {
  int fd = -1;
  std::uint64_t had = 0, most = 0, got = 0;
  int error = 0;
  Transfer* transfer = nullptr;
};

/// Only what continues the part is written: the page of an error is not.
std::size_t TakePart(char* from, std::size_t size, std::size_t count, void* into) {
  auto& part = *static_cast<OpenPart*>(into);
  const std::size_t bytes = size * count;
  const long expected = part.had > 0 ? 206 : 200;
  if (part.transfer->status() != expected || part.had + part.got + bytes > part.most) return 0;
  for (std::size_t done = 0; done < bytes;) {
    const ssize_t written = ::write(part.fd, from + done, bytes - done);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      part.error = errno;
      return 0;
    }
    done += static_cast<std::size_t>(written);
  }
  part.got += bytes;
  return bytes;
}

std::string DigestOf(const Descriptor& file) {
  crypto_hash_sha256_state state;
  crypto_hash_sha256_init(&state);
  std::array<std::byte, 1 << 16> buffer{};
  std::uint64_t offset = 0;
  for (ssize_t got = 0; (got = ReadAllAt(file.get(), offset, buffer)) > 0;
       offset += static_cast<std::uint64_t>(got))
    crypto_hash_sha256_update(&state, reinterpret_cast<const unsigned char*>(buffer.data()),
                              static_cast<unsigned long long>(got));
  std::array<unsigned char, crypto_hash_sha256_BYTES> digest{};
  crypto_hash_sha256_final(&state, digest.data());
  return fmt::format("{:02x}", fmt::join(digest, ""));
}

/// Parts of files that the index no longer names.
void RemoveOtherParts(const fs::path& folder, const fs::path& kept) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(".channel-") && name.ends_with(kPartEnd) && entry.path() != kept)
      fs::remove(entry.path(), ignored);
  }
}

/// One attempt to get the rest of a part.
/// @throws DataError
void FetchRest(const ChannelOptions& options, const ChannelBundle& bundle, const Descriptor& file,
               const std::stop_token& stop) {
  const off_t end = ::lseek(file.get(), 0, SEEK_END);
  OpenPart part{
      .fd = file.get(), .had = end > 0 ? static_cast<std::uint64_t>(end) : 0, .most = bundle.bytes};
  if (part.had >= bundle.bytes) return;
  Transfer transfer(options.url + "/" + bundle.name, kSchemes, options.trusted, stop);
  part.transfer = &transfer;
  transfer.SetLimits(std::chrono::seconds(10), kLongestDownload);
  transfer.Set(CURLOPT_LOW_SPEED_LIMIT, kLeastBytesPerSecond);
  transfer.Set(CURLOPT_LOW_SPEED_TIME, kSlowFor_s);
  transfer.Set(CURLOPT_RESUME_FROM_LARGE, static_cast<curl_off_t>(part.had));
  transfer.Set(CURLOPT_WRITEFUNCTION, &TakePart);
  transfer.Set(CURLOPT_WRITEDATA, static_cast<void*>(&part));
  const std::string failed = transfer.Perform();
  ::fsync(file.get());
  if (part.error != 0) throw DataError(say::channel::NoRoom(bundle.name));
  if (part.had + part.got == bundle.bytes) return;
  // A server that does not continue files: the next look begins again.
  if (part.had > 0 && part.got == 0 && transfer.status() == 200) (void)!::ftruncate(file.get(), 0);
  if (part.got == 0)
    throw DataError(say::channel::Unreachable(
        bundle.name, failed.empty() ? fmt::format("HTTP {}", transfer.status()) : failed));
  throw DataError(say::channel::Incomplete(bundle.name,
                                           static_cast<std::int64_t>(part.had + part.got),
                                           static_cast<std::int64_t>(bundle.bytes)));
}

/// @throws DataError
void Download(const ChannelOptions& options, const ChannelBundle& bundle,
              const std::stop_token& stop) {
  const fs::path target = options.folder / bundle.name;
  std::error_code error;
  if (fs::exists(target, error)) return;  // offered already, or put there by a person
  if (bundle.bytes > options.max_bytes) throw DataError(say::channel::NoRoom(bundle.name));
  fs::create_directories(options.folder, error);
  // Named by the contents: those of another index are not continued.
  const fs::path path = options.folder / fmt::format(".channel-{}{}", bundle.sha256, kPartEnd);
  RemoveOtherParts(options.folder, path);
  const fs::space_info space = fs::space(options.folder, error);
  const std::uintmax_t here = fs::exists(path, error) ? fs::file_size(path, error) : 0;
  if (!error && bundle.bytes > here && bundle.bytes - here > space.available)
    throw DataError(say::channel::NoRoom(bundle.name));
  const Descriptor file(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0640));
  if (file.get() < 0) throw DataError(say::channel::Unreachable(bundle.name, std::strerror(errno)));
  FetchRest(options, bundle, file, stop);
  if (DigestOf(file) != bundle.sha256) {
    fs::remove(path, error);
    throw DataError(say::channel::OtherContents(bundle.name));
  }
  fs::rename(path, target);
  const Descriptor folder(::open(options.folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  ::fsync(folder.get());
}

}  // namespace

ChannelLook LookAtChannel(const ChannelOptions& options, const std::stop_token& stop) {
  ChannelLook look;
  try {
    const std::string text = Fetch(options, "index.json", kMaxIndexBytes, stop);
    const std::string signature = Fetch(options, "index.sig", crypto_sign_BYTES, stop);
    const std::int64_t seen = SeenNumber(options.seen);
    const ChannelIndex index =
        ReadChannelIndex(text, signature, options.key, options.channel, seen);
    if (index.number > seen) KeepNumber(options.seen, index.number);
    const std::optional<ChannelBundle> offered = OfferedTo(index, options.serial, options.version);
    if (!offered) return look;
    Download(options, *offered, stop);
    look.name = offered->name;
    look.version = offered->version;
  } catch (const std::exception& error) {
    look.failure = MessageOf(error);
  }
  return look;
}

ChannelWatch::ChannelWatch(ChannelOptions options, std::function<void(const ChannelLook&)> looked)
    : options_(std::move(options)),
      looked_(std::move(looked)),
      thread_([this](const std::stop_token& stop) {
        std::mutex mutex;
        std::condition_variable_any stopped;
        std::unique_lock lock(mutex);
        for (auto pause = options_.first_after;;) {
          stopped.wait_for(lock, stop, pause, [] { return false; });
          if (stop.stop_requested()) return;
          const ChannelLook look = LookAtChannel(options_, stop);
          if (stop.stop_requested()) return;
          looked_(look);
          pause = look.failure.empty() ? options_.every : options_.again_after;
        }
      }) {}

}  // namespace plumb
