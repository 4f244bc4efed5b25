// SPDX-License-Identifier: Apache-2.0
// Reads the encrypted files of Plumb 0.2.0: XChaCha20-Poly1305 in libsodium's secret streams.
// Nothing is written in this format any more (age_file.hpp), and 0.4.0 will not read it.
//
// The key is derived from a secret, in a file of its own, and from public values beside the files:
// a random salt and the cost of the derivation (argon2id). Each file is a stream of pieces, bound
// to its path: a file that was truncated, reassembled or put in another's place is rejected.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <stop_token>
#include <string>

#include <sodium/crypto_generichash.h>
#include <nlohmann/json_fwd.hpp>

#include "daemon/scan_files/scan_files.hpp"

namespace plumb {

/// Contents of a key file: a line of text, which is a passphrase of at least 16 bytes or 32 random
/// bytes in hexadecimal. Erased on destruction.
class BackupSecret {
 public:
  /// On a FAT-formatted stick everybody may read every file.
  enum class Readers { kFew, kAny };
  /// @throws DataError if the file has no such line, or more than the allowed may read it; IoError
  explicit BackupSecret(const std::filesystem::path& file, Readers readers = Readers::kFew);
  ~BackupSecret();
  BackupSecret(const BackupSecret&) = delete;
  BackupSecret& operator=(const BackupSecret&) = delete;

 private:
  friend class FileCipher;
  std::string text_;
};

class FileCipher {
 public:
  /// The key to which `header` belongs: public values (salt, cost, and a check value for the key).
  /// Takes a second and 64 MB.
  /// @throws DataError if it is not a key of the secret, or no such header
  FileCipher(const BackupSecret& secret, const nlohmann::ordered_json& header);
  ~FileCipher();
  FileCipher(const FileCipher&) = delete;
  FileCipher& operator=(const FileCipher&) = delete;

  struct Written {
    FileDigest plain, sealed;
  };
  /// As Copy() of file_copy.hpp.
  /// @throws as Copy(); DataError if the file was not sealed with this key under this path
  [[nodiscard]] Written Open(const std::filesystem::path& from, const std::filesystem::path& to,
                             const std::string& path, const std::stop_token& stop) const;

  /// In hexadecimal; it cannot be forged without the key.
  [[nodiscard]] std::string Signature(const std::string& text) const;

 private:
  void Derive(const BackupSecret& secret);
  [[nodiscard]] std::string KeyedHash(const char* purpose, const std::string& text) const;

  static constexpr std::size_t kKeyBytes = 32, kSaltBytes = 16;
  std::array<unsigned char, kSaltBytes> salt_{};
  std::uint64_t operations_ = 0, memory_bytes_ = 0;
  std::array<unsigned char, kKeyBytes> key_{};
};

}  // namespace plumb
