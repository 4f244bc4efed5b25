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

#include <fmt/format.h>

namespace plumb {
namespace {

/// A bundle ends with its signature and the signature's size in eight bytes; it begins as a
/// squashfs.
constexpr std::string_view kSquashfs = "hsqs";
constexpr std::uint64_t kLeastBundle = 4096;
constexpr int kMaxVersion = 64;

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

}  // namespace

std::string WhyNoBundle(const std::filesystem::path& file, std::uint64_t max_bytes) {
  const std::string name = file.filename().string();
  const int fd = ::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) {
    const int why = errno;
    struct stat info {};
    if (why == EACCES && ::lstat(file.c_str(), &info) == 0 && S_ISREG(info.st_mode) &&
        info.st_uid == 0 && (info.st_mode & 077) == 0)
      return {};
    return fmt::format("{} cannot be read: {}", name, std::strerror(why));
  }
  const auto check = [&]() -> std::string {
    struct stat info {};
    if (::fstat(fd, &info) != 0 || !S_ISREG(info.st_mode)) return name + " is not a regular file";
    const auto size = static_cast<std::uint64_t>(info.st_size);
    if (size < kLeastBundle)
      return fmt::format("{} is too short for a bundle: {} bytes; copy it again", name, size);
    if (size > max_bytes)
      return fmt::format("{} is too large: {} MB, at most {} MB", name, size >> 20,
                         max_bytes >> 20);
    std::array<char, 4> magic{};
    std::array<unsigned char, 8> tail{};
    if (::pread(fd, magic.data(), magic.size(), 0) != static_cast<ssize_t>(magic.size()) ||
        ::pread(fd, tail.data(), tail.size(), static_cast<off_t>(size - tail.size())) !=
            static_cast<ssize_t>(tail.size())) {
      return fmt::format("{} cannot be read: {}", name, std::strerror(errno));
    }
    std::uint64_t signature = 0;
    for (const unsigned char byte : tail) signature = signature << 8 | byte;
    if (std::string_view(magic.data(), magic.size()) != kSquashfs)
      return name + " is not a bundle: expected a squashfs image";
    if (signature == 0 || signature > kMaxSignature || signature + tail.size() >= size) {
      return name + " is not a complete bundle: no signature at its end; copy it again";
    }
    return {};
  };
  std::string why = check();
  ::close(fd);
  return why;
}

std::string WhyNoVersion(const std::string& version) {
  bool is_number = false;
  for (const char c : version) {
    if (!IsDigit(c) && (c != '.' || !is_number)) {
      is_number = false;
      break;
    }
    is_number = IsDigit(c);
  }
  if (is_number) return {};
  return fmt::format(
      "this bundle holds version '{}': expected numbers separated by dots, such as 0.2.1; ask "
      "who made it",
      version);
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
