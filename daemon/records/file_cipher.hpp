// Files that only who has the key can read: XChaCha20-Poly1305 in libsodium's secret streams.
//
// The key comes of a secret, in a file of its own, and of what lies open beside the files: a random
// salt and what the derivation cost (argon2id). Each file is a stream of pieces, bound to its path:
// a file that was cut short, reassembled or put in another's place is refused.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <stop_token>
#include <string>

#include <sodium/crypto_generichash.h>
#include <nlohmann/json_fwd.hpp>

#include "daemon/records/scan_files.hpp"

namespace plumb {

/// What is in a key file: a line of text, a passphrase of at least 16 bytes or 32 random bytes in
/// hexadecimal. Forgotten when it goes.
class BackupSecret {
 public:
  /// @throws DataError if the file holds no such line, or everybody may read it; IoError
  explicit BackupSecret(const std::filesystem::path& file);
  ~BackupSecret();
  BackupSecret(const BackupSecret&) = delete;
  BackupSecret& operator=(const BackupSecret&) = delete;

 private:
  friend class FileCipher;
  std::string text_;
};

class FileCipher {
 public:
  /// A new key of the secret. Takes a second and 64 MB.
  explicit FileCipher(const BackupSecret& secret);
  /// The key that `header` belongs to. @throws DataError if it is none of the secret's, or the
  /// header none of Header()
  FileCipher(const BackupSecret& secret, const nlohmann::ordered_json& header);
  ~FileCipher();
  FileCipher(const FileCipher&) = delete;
  FileCipher& operator=(const FileCipher&) = delete;

  /// What must be known beside the secret: salt, cost, and by what the key is recognised.
  [[nodiscard]] nlohmann::ordered_json Header() const;

  struct Written {
    FileDigest plain, sealed;
  };
  /// As Copy() of file_copy.hpp, in the direction named. @throws as that; DataError if the file
  /// is none that this key sealed under this path
  [[nodiscard]] Written Seal(const std::filesystem::path& from, const std::filesystem::path& to,
                             const std::string& path, const std::stop_token& stop) const;
  [[nodiscard]] Written Open(const std::filesystem::path& from, const std::filesystem::path& to,
                             const std::string& path, const std::stop_token& stop) const;

  /// In hexadecimal; it cannot be forged without the key.
  [[nodiscard]] std::string Signature(const std::string& text) const;

 private:
  void Derive(const BackupSecret& secret);
  [[nodiscard]] std::string KeyedHash(const char* purpose, const std::string& text) const;

  static constexpr std::size_t kKeyBytes = 32, kSaltBytes = 16;
  std::array<unsigned char, kSaltBytes> salt_{};
  std::uint64_t operations_ = 3, memory_bytes_ = std::uint64_t{64} << 20;
  std::array<unsigned char, kKeyBytes> key_{};
};

}  // namespace plumb
