// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/sha256.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sodium.h>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "drivers/files/descriptor.hpp"
#include "words/file.hpp"

namespace plumb {

Sha256::Sha256() { crypto_hash_sha256_init(&state_); }

void Sha256::Add(const void* bytes, std::size_t count) {
  crypto_hash_sha256_update(&state_, static_cast<const unsigned char*>(bytes), count);
}

std::string Sha256::Hex() {
  std::array<unsigned char, crypto_hash_sha256_BYTES> hash{};
  crypto_hash_sha256_final(&state_, hash.data());
  return HexOf(hash);
}

std::string HexOf(std::span<const unsigned char> bytes) {
  return fmt::format("{:02x}", fmt::join(bytes, ""));
}

std::string Sha256Of(std::string_view text) {
  Sha256 hash;
  hash.Add(text.data(), text.size());
  return hash.Hex();
}

FileSum SumOfFile(const std::filesystem::path& path, const std::stop_token& stop) {
  const auto fail = [&path](int error) {
    throw IoError(say::file::CannotRead(path.string(), std::strerror(error)));
  };
  const Descriptor file = OpenForReading(path);
  struct stat status {};
  if (file.get() < 0 || ::fstat(file.get(), &status) != 0) fail(errno);
  if (!S_ISREG(status.st_mode)) fail(S_ISDIR(status.st_mode) ? EISDIR : EINVAL);
  Sha256 hash;
  FileSum sum;
  std::vector<char> buffer(std::size_t{256} << 10);
  for (;;) {
    CheckStop(stop);
    const ssize_t count = ::read(file.get(), buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail(errno);
    if (count == 0) break;
    hash.Add(buffer.data(), static_cast<std::size_t>(count));
    sum.bytes += static_cast<std::uint64_t>(count);
  }
  sum.sha256 = hash.Hex();
  return sum;
}

}  // namespace plumb
