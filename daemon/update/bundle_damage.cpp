// SPDX-License-Identifier: Apache-2.0
// Whether a bundle is still what was signed. A bundle is a squashfs, followed by a signature (CMS,
// DER) and the signature's size in eight bytes. Signed attributes contain the SHA-256 of the signed
// data: of the squashfs (plain format), or of the manifest, which is then part of the CMS (verity
// format).
#include <fcntl.h>
#include <sodium.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/update/bundle_check.hpp"
#include "drivers/files/descriptor.hpp"

namespace plumb {
namespace {

constexpr std::string_view kManifestBegin = "[update]";
/// Object identifier of SHA-256 in DER; without it another digest was used.
constexpr std::array<unsigned char, 11> kSha256{0x06, 0x09, 0x60, 0x86, 0x48, 0x01,
                                                0x65, 0x03, 0x04, 0x02, 0x01};

using Bytes = std::vector<unsigned char>;
using Digest = std::array<unsigned char, crypto_hash_sha256_BYTES>;

template <typename Wanted>
bool Holds(const Bytes& bytes, const Wanted& wanted) {
  return std::search(bytes.begin(), bytes.end(), wanted.begin(), wanted.end()) != bytes.end();
}

std::uint64_t SizeOf(const Descriptor& file) {
  const off_t end = file.get() < 0 ? -1 : ::lseek(file.get(), 0, SEEK_END);
  return end < 0 ? 0 : static_cast<std::uint64_t>(end);
}

std::optional<Bytes> Read(const Descriptor& file, std::uint64_t at, std::size_t count) {
  Bytes bytes(count);
  if (ReadAllAt(file.get(), at, std::as_writable_bytes(std::span(bytes))) !=
      static_cast<ssize_t>(count))
    return std::nullopt;
  return bytes;
}

/// The content of a CMS from its own beginning on; its length precedes it.
std::optional<Bytes> ManifestIn(const Bytes& cms) {
  const auto begin =
      std::search(cms.begin(), cms.end(), kManifestBegin.begin(), kManifestBegin.end());
  if (begin == cms.end()) return std::nullopt;
  // An octet string: 04 LL, 04 81 LL or 04 82 LL LL.
  const auto before = [&](std::ptrdiff_t back) -> unsigned {
    return begin - cms.begin() >= back ? *(begin - back) : 0U;
  };
  std::size_t length = 0;
  if (before(4) == 0x04 && before(3) == 0x82) {
    length = before(2) << 8 | before(1);
  } else if (before(3) == 0x04 && before(2) == 0x81) {
    length = before(1);
  } else if (before(2) == 0x04 && before(1) < 0x80) {
    length = before(1);
  }
  if (length == 0 || length > static_cast<std::size_t>(cms.end() - begin)) return std::nullopt;
  return Bytes(begin, begin + static_cast<std::ptrdiff_t>(length));
}

std::optional<Digest> DigestOf(const Descriptor& file, std::uint64_t count,
                               const std::stop_token& stop) {
  constexpr std::size_t kStep = 1 << 20;
  crypto_hash_sha256_state state;
  crypto_hash_sha256_init(&state);
  for (std::uint64_t at = 0; at < count; at += kStep) {
    if (stop.stop_requested()) return std::nullopt;
    const auto bytes =
        Read(file, at, static_cast<std::size_t>(std::min<std::uint64_t>(kStep, count - at)));
    if (!bytes) return std::nullopt;
    crypto_hash_sha256_update(&state, bytes->data(), bytes->size());
  }
  Digest digest;
  crypto_hash_sha256_final(&state, digest.data());
  return digest;
}

}  // namespace

BundleState LookForDamage(const std::filesystem::path& path, const std::stop_token& stop) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK));
  const std::uint64_t size = SizeOf(file);
  if (size <= 8) return BundleState::kUnknown;
  const auto tail = Read(file, size - 8, 8);
  if (!tail) return BundleState::kUnknown;
  std::uint64_t signature = 0;
  for (const unsigned char byte : *tail) signature = signature << 8 | byte;
  if (signature == 0 || signature > kMaxSignature || signature + 8 >= size)
    return BundleState::kUnknown;
  const auto cms = Read(file, size - 8 - signature, static_cast<std::size_t>(signature));
  if (!cms || !Holds(*cms, kSha256)) return BundleState::kUnknown;

  if (const auto manifest = ManifestIn(*cms)) {
    Digest digest;
    crypto_hash_sha256(digest.data(), manifest->data(), manifest->size());
    return Holds(*cms, digest) ? BundleState::kWhole : BundleState::kDamaged;
  }
  const auto digest = DigestOf(file, size - 8 - signature, stop);
  if (!digest) return BundleState::kUnknown;
  return Holds(*cms, *digest) ? BundleState::kWhole : BundleState::kDamaged;
}

}  // namespace plumb
