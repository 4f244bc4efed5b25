// SPDX-License-Identifier: Apache-2.0
#include "drivers/openni/oni_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <map>
#include <utility>

#include "algo/base/errors.hpp"
#include "drivers/files/descriptor.hpp"
#include "drivers/files/file_io.hpp"
#include "words/recording.hpp"

namespace plumb {
namespace {

// All numbers are little-endian. File header: magic, version (8 bytes), largest stamp (8), largest
// node id (4).
constexpr std::array<std::uint8_t, 4> kFileMagic{'N', 'I', '1', '0'};
constexpr std::uint64_t kFileHeader = 24;
// Record header: magic, kind, node, size of header and fields, size of the payload that follows (4
// bytes each), place of an undone record (8).
constexpr std::array<std::uint8_t, 4> kRecordMagic{'N', 'I', 'R', 0};
constexpr std::uint64_t kRecordHeader = 28;
constexpr std::uint32_t kDataBegin = 8;
constexpr std::uint32_t kNewData = 10;  // its fields begin with the stamp
constexpr std::uint32_t kEndRecord = 11;
constexpr std::uint32_t kNodeAdded = 13;  // fields: length of the name, the name, kind of the node
constexpr std::uint32_t kDepthNode = 2;
constexpr std::uint32_t kColorNode = 3;
constexpr std::size_t kMaxNodes = 64;
constexpr std::uint32_t kMaxName = 1024;
constexpr std::uint64_t kMaxRecords = 20'000'000;

std::uint32_t Number(std::span<const std::uint8_t> bytes, std::size_t at) {
  return bytes[at] | std::uint32_t{bytes[at + 1]} << 8 | std::uint32_t{bytes[at + 2]} << 16 |
         std::uint32_t{bytes[at + 3]} << 24;
}

Descriptor OpenedFor(int flags, const std::filesystem::path& file) {
  return Descriptor(::open(file.c_str(), flags | O_CLOEXEC | O_NONBLOCK));
}

bool IsRegular(const Descriptor& file) {
  struct stat status {};
  return file.get() >= 0 && ::fstat(file.get(), &status) == 0 && S_ISREG(status.st_mode);
}

bool ReadAt(int descriptor, std::uint64_t offset, std::span<std::uint8_t> bytes) {
  return ReadAllAt(descriptor, offset, std::as_writable_bytes(bytes)) == std::ssize(bytes);
}

/// 0 if unknown.
std::uint32_t NodeKind(const ReadBytes& read, std::uint64_t fields) {
  std::array<std::uint8_t, 4> bytes{};
  if (!read(fields, bytes)) return 0;
  const std::uint32_t name = Number(bytes, 0);
  return name <= kMaxName && read(fields + bytes.size() + name, bytes) ? Number(bytes, 0) : 0;
}

}  // namespace

std::optional<OniFileSummary> SummariseOniFile(const ReadBytes& read) {
  std::array<std::uint8_t, kRecordHeader> bytes{};
  if (!read(0, std::span(bytes).first(kFileMagic.size())) ||
      !std::equal(kFileMagic.begin(), kFileMagic.end(), bytes.begin()))
    return std::nullopt;
  OniFileSummary found;
  found.end = kFileHeader;
  std::map<std::uint32_t, std::uint32_t> kinds;  // kinds of the nodes
  for (std::uint64_t record = 0; record < kMaxRecords; ++record) {
    if (!read(found.end, bytes) ||
        !std::equal(kRecordMagic.begin(), kRecordMagic.end(), bytes.begin()))
      return std::nullopt;
    const std::uint32_t kind = Number(bytes, 4), node = Number(bytes, 8);
    const std::uint64_t size = Number(bytes, 12), payload = Number(bytes, 16);
    if (size < kRecordHeader) return std::nullopt;
    if (kind == kNodeAdded && kinds.size() < kMaxNodes)
      kinds[node] = NodeKind(read, found.end + kRecordHeader);
    if (kind == kNewData) {
      std::array<std::uint8_t, 8> stamp{};
      if (!read(found.end + kRecordHeader, stamp)) return std::nullopt;
      const auto stamp_us =
          static_cast<std::int64_t>(Number(stamp, 0) | std::uint64_t{Number(stamp, 4)} << 32);
      if (kinds[node] == kDepthNode) found.depth_us.push_back(stamp_us);
      if (kinds[node] == kColorNode) found.color_us.push_back(stamp_us);
    }
    found.end += size + payload;
    if (kind == kEndRecord) return found;
  }
  return std::nullopt;
}

bool HasOniDataBegun(const std::filesystem::path& file, int num_streams) {
  const Descriptor descriptor = OpenedFor(O_RDONLY, file);
  std::array<std::uint8_t, kRecordHeader> bytes{};
  int num_begun = 0;
  for (std::uint64_t at = kFileHeader; num_begun < num_streams;
       at += Number(bytes, 12) + std::uint64_t{Number(bytes, 16)}) {
    if (!IsRegular(descriptor) || !ReadAt(descriptor.get(), at, bytes)) return false;
    const bool is_record = std::equal(kRecordMagic.begin(), kRecordMagic.end(), bytes.begin()) &&
                           Number(bytes, 12) >= kRecordHeader;
    if (!is_record) return false;
    num_begun += Number(bytes, 4) == kDataBegin ? 1 : 0;
  }
  return true;
}

std::optional<OniFileSummary> SummariseOniFile(const std::filesystem::path& file) {
  const Descriptor descriptor = OpenedFor(O_RDONLY, file);
  if (!IsRegular(descriptor)) return std::nullopt;
  return SummariseOniFile([&](std::uint64_t offset, std::span<std::uint8_t> bytes) {
    return ReadAt(descriptor.get(), offset, bytes);
  });
}

bool IsOniFile(const std::filesystem::path& file) {
  const Descriptor descriptor = OpenedFor(O_RDONLY, file);
  std::array<std::uint8_t, kFileMagic.size()> magic{};
  return IsRegular(descriptor) && ReadAt(descriptor.get(), 0, magic) && magic == kFileMagic;
}

OniFileSummary TrimOniFile(const std::filesystem::path& file) {
  std::optional<OniFileSummary> found = SummariseOniFile(file);
  if (!found) throw IoError(say::recording::OniUnfinished(file.string()));
  const Descriptor descriptor = OpenedFor(O_WRONLY, file);
  struct stat status {};
  if (descriptor.get() < 0 || ::fstat(descriptor.get(), &status) != 0)
    throw IoError(DescribeWriteError(file, errno));
  if (static_cast<std::uint64_t>(status.st_size) < found->end)
    throw IoError(say::recording::OniEndsEarly(file.string()));
  if (::ftruncate(descriptor.get(), static_cast<off_t>(found->end)) != 0 ||
      ::fsync(descriptor.get()) != 0)
    throw IoError(DescribeWriteError(file, errno));
  return std::move(*found);
}

std::optional<std::int64_t> FindOniBegin(std::span<const std::int64_t> recorded_us,
                                         std::span<const std::int64_t> seen_us) {
  constexpr std::int64_t kTolerance_us = 2;
  constexpr std::size_t kMaxTried = 300, kMaxCompared = 100;
  std::vector<std::int64_t> seen(seen_us.begin(), seen_us.end());
  std::sort(seen.begin(), seen.end());
  const auto recorded = recorded_us.first(std::min(recorded_us.size(), kMaxCompared));
  std::size_t best = 0;
  std::optional<std::int64_t> begin;
  // The first image seen may be any of the first recorded, and vice versa.
  const auto try_begin = [&](std::int64_t candidate) {
    std::size_t matches = 0;
    for (const std::int64_t stamp : recorded) {
      const auto near =
          std::lower_bound(seen.begin(), seen.end(), candidate + stamp - kTolerance_us);
      matches += near != seen.end() && *near <= candidate + stamp + kTolerance_us ? 1 : 0;
    }
    if (matches > best) {
      best = matches;
      begin = candidate;
    }
  };
  for (const std::int64_t stamp : recorded.first(std::min<std::size_t>(recorded.size(), 10))) {
    for (std::size_t i = 0; i < std::min(seen.size(), kMaxTried); ++i) try_begin(seen[i] - stamp);
  }
  return 2 * best >= std::min(recorded.size(), seen.size()) ? begin : std::nullopt;
}

std::string OniBeginText(const OniBegin& begin) {
  return fmt::format("color_begin_us: {}\ndepth_begin_us: {}\n", begin.color_us, begin.depth_us);
}

OniBegin ParseOniBegin(std::string_view text) {
  constexpr std::int64_t kMax_us = std::int64_t{1} << 53;
  const auto number = [&](std::string_view key) -> std::int64_t {
    const std::size_t at = text.find(key);
    if (at == std::string_view::npos) return 0;
    std::int64_t value = 0;
    const std::string_view rest = text.substr(at + key.size());
    std::from_chars(rest.data(), rest.data() + rest.size(), value);
    return std::clamp<std::int64_t>(value, 0, kMax_us);
  };
  return {number("\ncolor_begin_us: "), number("\ndepth_begin_us: ")};
}

std::filesystem::path OniSideCar(const std::filesystem::path& file) {
  std::filesystem::path side_car = file;
  side_car += ".yaml";
  return side_car;
}

}  // namespace plumb
