// SPDX-License-Identifier: Apache-2.0
#include "daemon/archive/file_cipher.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <vector>

#include <fmt/format.h>
#include <sodium/core.h>
#include <sodium/crypto_pwhash_argon2id.h>
#include <sodium/crypto_secretstream_xchacha20poly1305.h>
#include <sodium/utils.h>
#include <nlohmann/json.hpp>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "daemon/scan_files/file_copy.hpp"
#include "drivers/files/descriptor.hpp"
#include "drivers/files/file_io.hpp"
#include "words/backup.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMinSecret = 16, kMaxSecret = 1024;
constexpr std::size_t kCipherPiece = std::size_t{64} << 10;
constexpr std::size_t kOverhead = crypto_secretstream_xchacha20poly1305_ABYTES;
// Limits for the work that a backup may demand of the machine that restores it.
constexpr std::uint64_t kMaxOperations = 16, kMaxMemory = std::uint64_t{512} << 20;
constexpr const char* kAlgorithm = "argon2id, xchacha20poly1305";

void StartSodium() {
  if (::sodium_init() < 0) throw IoError(say::backup::NoRandomNumbers());
}

/// Reads a file in pieces and knows which is the last.
class Pieces {
 public:
  Pieces(const fs::path& path, std::size_t size)
      : path_(path), fd_(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)), next_(size) {
    struct stat status {};
    if (fd_.get() < 0 || ::fstat(fd_.get(), &status) != 0) Fail(errno);
    if (!S_ISREG(status.st_mode)) Fail(EINVAL);
  }

  /// At most the given number of bytes; fewer only at the end of the file.
  std::vector<std::uint8_t> Exactly(std::size_t count) {
    std::vector<std::uint8_t> bytes(count);
    std::size_t filled = 0;
    while (filled < count) {
      const ssize_t got = ::read(fd_.get(), bytes.data() + filled, count - filled);
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) Fail(errno);
      if (got == 0) break;
      filled += static_cast<std::size_t>(got);
    }
    bytes.resize(filled);
    return bytes;
  }
  /// Starts the pieces after the result of Exactly().
  void Begin() { ahead_ = Exactly(next_); }
  std::vector<std::uint8_t> Take() {
    std::vector<std::uint8_t> piece = std::move(ahead_);
    ahead_ = piece.size() < next_ ? std::vector<std::uint8_t>() : Exactly(next_);
    return piece;
  }
  /// About the last result of Take().
  [[nodiscard]] bool is_last() const { return ahead_.empty(); }

 private:
  [[noreturn]] void Fail(int error) const {
    throw SourceUnreadable(say::backup::NotRead(path_.string(), std::strerror(error)));
  }
  fs::path path_;
  Descriptor fd_;
  std::size_t next_;
  std::vector<std::uint8_t> ahead_;
};

const unsigned char* Bytes(const std::string& text) {
  return reinterpret_cast<const unsigned char*>(text.data());
}

/// Sealed into each piece of a file, so that files of one backup cannot be exchanged.
const std::string& PlaceOf(const std::string& path) { return path; }

}  // namespace

BackupSecret::BackupSecret(const fs::path& file, Readers readers) {
  struct stat status {};
  if (readers == Readers::kFew && ::stat(file.c_str(), &status) == 0 &&
      (status.st_mode & S_IROTH) != 0)
    throw DataError(say::backup::KeyReadableByAll(file.string()));
  text_ = ReadTextFile(file, kMaxSecret + 1);
  while (!text_.empty() && (text_.back() == '\n' || text_.back() == '\r')) text_.pop_back();
  if (text_.size() < kMinSecret || text_.size() > kMaxSecret ||
      text_.find('\n') != std::string::npos)
    throw DataError(say::backup::NoKey(file.string(), kMinSecret, kMaxSecret));
}

BackupSecret::~BackupSecret() { ::sodium_memzero(text_.data(), text_.size()); }

FileCipher::FileCipher(const BackupSecret& secret, const Json& header) {
  StartSodium();
  std::size_t length = 0;
  const auto text = [&](const char* name) {
    const auto field = header.is_object() ? header.find(name) : header.end();
    return header.is_object() && field != header.end() && field->is_string()
               ? field->get<std::string>()
               : std::string();
  };
  const auto number = [&](const char* name, std::uint64_t most) -> std::uint64_t {
    const auto field = header.find(name);
    if (field == header.end() || !field->is_number_unsigned() || *field > most) return 0;
    return field->get<std::uint64_t>();
  };
  const std::string salt = text("salt");
  const bool has_salt = ::sodium_hex2bin(salt_.data(), salt_.size(), salt.data(), salt.size(),
                                         nullptr, &length, nullptr) == 0 &&
                        length == salt_.size() && salt.size() == 2 * salt_.size();
  if (text("algorithm") != kAlgorithm || !has_salt)
    throw DataError(say::backup::UnknownEncryption());
  operations_ = number("operations", kMaxOperations);
  memory_bytes_ = number("memory_bytes", kMaxMemory);
  Derive(secret);
  if (text("key") != KeyedHash("key", "")) throw DataError(say::backup::OtherKey());
}

FileCipher::~FileCipher() { ::sodium_memzero(key_.data(), key_.size()); }

void FileCipher::Derive(const BackupSecret& secret) {
  if (::crypto_pwhash_argon2id(key_.data(), key_.size(), secret.text_.data(), secret.text_.size(),
                               salt_.data(), operations_, memory_bytes_,
                               crypto_pwhash_argon2id_ALG_ARGON2ID13) != 0)
    throw DataError(say::backup::NoDerivedKey(static_cast<std::int64_t>(operations_),
                                              static_cast<std::int64_t>(memory_bytes_)));
}

std::string FileCipher::KeyedHash(const char* purpose, const std::string& text) const {
  std::array<unsigned char, crypto_generichash_BYTES> hash{};
  const std::string named = fmt::format("plumb backup, {}\n{}", purpose, text);
  ::crypto_generichash(hash.data(), hash.size(), Bytes(named), named.size(), key_.data(),
                       key_.size());
  return HexOf(hash);
}

std::string FileCipher::Signature(const std::string& text) const {
  return KeyedHash("signature", text);
}

FileCipher::Written FileCipher::Open(const fs::path& from, const fs::path& to,
                                     const std::string& path, const std::stop_token& stop) const {
  const auto fail = [&path] { throw DataError(say::backup::SealedChanged(path)); };
  const std::string& place = PlaceOf(path);
  Pieces pieces(from / path, kCipherPiece + kOverhead);
  const std::vector<std::uint8_t> header =
      pieces.Exactly(crypto_secretstream_xchacha20poly1305_HEADERBYTES);
  crypto_secretstream_xchacha20poly1305_state state;
  if (header.size() != crypto_secretstream_xchacha20poly1305_HEADERBYTES ||
      ::crypto_secretstream_xchacha20poly1305_init_pull(&state, header.data(), key_.data()) != 0)
    fail();
  pieces.Begin();
  DigestingWriter target(to, path);
  Sha256 sealed_hash;
  sealed_hash.Add(header.data(), header.size());
  Written written{.plain = {}, .sealed = {.path = path, .bytes = header.size()}};
  do {
    CheckStop(stop);
    const std::vector<std::uint8_t> piece = pieces.Take();
    if (piece.size() < kOverhead) fail();
    std::vector<std::uint8_t> plain(piece.size() - kOverhead);
    unsigned char tag = 0;
    if (::crypto_secretstream_xchacha20poly1305_pull(&state, plain.data(), nullptr, &tag,
                                                     piece.data(), piece.size(), Bytes(place),
                                                     place.size()) != 0 ||
        (tag == crypto_secretstream_xchacha20poly1305_TAG_FINAL) != pieces.is_last())
      fail();
    target.Write(plain);
    sealed_hash.Add(piece.data(), piece.size());
    written.sealed.bytes += piece.size();
  } while (!pieces.is_last());
  ::sodium_memzero(&state, sizeof state);
  written.plain = target.Close();
  written.sealed.sha256 = sealed_hash.Hex();
  return written;
}

}  // namespace plumb
