// SPDX-License-Identifier: Apache-2.0
#include "daemon/update/bundle_check.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iomanip>
#include <string_view>

#include "words/update.hpp"

namespace plumb {
namespace {

/// A bundle ends with its signature and the signature's size in eight bytes; it begins as a
/// squashfs.
constexpr std::string_view kSquashfs = "hsqs";
constexpr std::uint64_t kLeastBundle = 4096;
constexpr int kMaxVersion = 64;

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

}  // namespace

bool IsBundleName(std::string_view name) {
  constexpr std::string_view kEnd = ".raucb", kAlso = "._-";
  return name.size() > kEnd.size() && name.size() <= 64 && name.ends_with(kEnd) &&
         name.front() != '.' && name.front() != '-' &&
         std::all_of(name.begin(), name.end(), [&](char c) {
           return IsDigit(c) || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                  kAlso.find(c) != std::string_view::npos;
         });
}

Message WhyNoBundle(const std::filesystem::path& file, std::uint64_t max_bytes,
                    const std::string& name) {
  const int fd = ::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) {
    const int why = errno;
    struct stat info {};
    if (why == EACCES && ::lstat(file.c_str(), &info) == 0 && S_ISREG(info.st_mode) &&
        info.st_uid == 0 && (info.st_mode & 077) == 0)
      return {};
    return say::update::Unreadable(name, std::strerror(why));
  }
  const auto check = [&]() -> Message {
    struct stat info {};
    if (::fstat(fd, &info) != 0 || !S_ISREG(info.st_mode)) return say::update::NoRegularFile(name);
    const auto size = static_cast<std::uint64_t>(info.st_size);
    if (size < kLeastBundle) return say::update::TooShort(name, static_cast<double>(size));
    if (size > max_bytes)
      return say::update::TooLarge(name, WholeMegabytes(size), WholeMegabytes(max_bytes));
    std::array<char, 4> magic{};
    std::array<unsigned char, 8> tail{};
    if (::pread(fd, magic.data(), magic.size(), 0) != static_cast<ssize_t>(magic.size()) ||
        ::pread(fd, tail.data(), tail.size(), static_cast<off_t>(size - tail.size())) !=
            static_cast<ssize_t>(tail.size())) {
      return say::update::Unreadable(name, std::strerror(errno));
    }
    std::uint64_t signature = 0;
    for (const unsigned char byte : tail) signature = signature << 8 | byte;
    if (std::string_view(magic.data(), magic.size()) != kSquashfs)
      return say::update::NoSquashfs(name);
    if (signature == 0 || signature > kMaxSignature || signature + tail.size() >= size) {
      return say::update::NoSignature(name);
    }
    return {};
  };
  Message why = check();
  ::close(fd);
  return why;
}

Message WhyNoVersion(const std::string& version) {
  bool is_number = false;
  for (const char c : version) {
    if (!IsDigit(c) && (c != '.' || !is_number)) {
      is_number = false;
      break;
    }
    is_number = IsDigit(c);
  }
  if (is_number) return {};
  return say::update::NoVersion(version);
}

bool IsOlder(const std::string& a, const std::string& b) {
  // Numbers are compared as text without leading zeros, so that no number is too large.
  const auto next = [](std::string_view& rest) {
    const auto dot = rest.find('.');
    const std::string_view part = rest.substr(0, dot);
    rest = dot == std::string_view::npos ? std::string_view() : rest.substr(dot + 1);
    return part.substr(std::min(part.find_first_not_of('0'), part.size()));
  };
  const auto numbers = [](std::string_view version) {
    return version.substr(0, version.find_first_not_of("0123456789."));
  };
  std::string_view left = numbers(a), right = numbers(b);
  while (!left.empty() || !right.empty()) {
    const std::string_view x = next(left), y = next(right);
    if (x.size() != y.size()) return x.size() < y.size();
    if (x != y) return x < y;
  }
  return false;
}

std::string VersionOfSystem(const std::filesystem::path& release, const std::string& program) {
  std::ifstream file(release);
  std::string version;
  file >> std::setw(kMaxVersion) >> version;
  return version.empty() || !IsDigit(version.front()) ? program : version;
}

}  // namespace plumb
