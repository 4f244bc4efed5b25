// SPDX-License-Identifier: Apache-2.0
// Encrypts a folder as Plumb 0.2.0 did, which the product cannot do any more.
#pragma once

#include <array>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sodium.h>
#include <nlohmann/json.hpp>

#include "daemon/archive/summed_folder.hpp"
#include "daemon/archive/tar_file.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb::testing {

class OldCipher {
 public:
  explicit OldCipher(const std::string& secret) {
    if (::sodium_init() < 0) throw std::runtime_error("libsodium does not start");
    ::randombytes_buf(salt_.data(), salt_.size());
    if (::crypto_pwhash_argon2id(key_.data(), key_.size(), secret.data(), secret.size(),
                                 salt_.data(), kOperations, kMemory,
                                 crypto_pwhash_argon2id_ALG_ARGON2ID13) != 0)
      throw std::runtime_error("no key");
  }

  [[nodiscard]] nlohmann::ordered_json Header() const {
    return {{"algorithm", "argon2id, xchacha20poly1305"},
            {"salt", HexOf(salt_)},
            {"operations", kOperations},
            {"memory_bytes", kMemory},
            {"key", KeyedHash("key", "")}};
  }

  [[nodiscard]] std::string Seal(const std::string& plain, const std::string& path) const {
    constexpr std::size_t kPiece = 65536;
    crypto_secretstream_xchacha20poly1305_state state;
    std::string sealed(crypto_secretstream_xchacha20poly1305_HEADERBYTES, '\0');
    ::crypto_secretstream_xchacha20poly1305_init_push(&state, Bytes(sealed), key_.data());
    for (std::size_t at = 0; at == 0 || at < plain.size(); at += kPiece) {
      std::string piece = plain.substr(at, kPiece);
      std::string out(piece.size() + crypto_secretstream_xchacha20poly1305_ABYTES, '\0');
      std::string place = path;
      ::crypto_secretstream_xchacha20poly1305_push(
          &state, Bytes(out), nullptr, Bytes(piece), piece.size(), Bytes(place), place.size(),
          at + kPiece >= plain.size() ? crypto_secretstream_xchacha20poly1305_TAG_FINAL : 0);
      sealed += out;
    }
    return sealed;
  }

  [[nodiscard]] std::string KeyedHash(const char* purpose, const std::string& text) const {
    std::array<unsigned char, crypto_generichash_BYTES> hash{};
    std::string named = fmt::format("plumb backup, {}\n{}", purpose, text);
    ::crypto_generichash(hash.data(), hash.size(), Bytes(named), named.size(), key_.data(),
                         key_.size());
    return HexOf(hash);
  }

 private:
  static constexpr std::uint64_t kOperations = 3, kMemory = std::uint64_t{64} << 20;
  static unsigned char* Bytes(std::string& text) {
    return reinterpret_cast<unsigned char*>(text.data());
  }

  std::array<unsigned char, 16> salt_{};
  std::array<unsigned char, 32> key_{};
};

/// Encrypts every file of a backup or an export that is a folder, with a new key of the secret.
/// @param about_file  "backup.json"
inline void SealAsOld(const std::filesystem::path& folder, const std::string& about_file,
                      const std::string& secret) {
  const OldCipher cipher(secret);
  const auto files = FilesBelow(folder);
  std::istringstream lines(files.at("SHA256SUMS"));
  std::string sums;
  for (std::string line; std::getline(lines, line);) {
    const std::string path = line.substr(66);
    WriteWholeFile(folder / path, std::string_view(cipher.Seal(files.at(path), path)));
    sums += DigestOfFile(folder, path).sha256 + "  " + path + "\n";
  }
  WriteWholeFile(folder / "SHA256SUMS", std::string_view(sums));
  auto about = nlohmann::ordered_json::parse(files.at(about_file));
  about["sha256sums"] = DigestOfFile(folder, "SHA256SUMS").sha256;
  about["encryption"] = cipher.Header();
  about["signature"] = cipher.KeyedHash("signature", sums);
  WriteWholeFile(folder / about_file, std::string_view(about.dump(2) + "\n"));
}

/// The same folder as one file.
inline void PackAsOld(const std::filesystem::path& folder, const std::filesystem::path& file) {
  std::filesystem::remove(file);
  std::filesystem::create_directories(file.parent_path());
  TarWriter tar(file);
  for (const auto& [path, content] : FilesBelow(folder)) tar.AddText(path, content);
  tar.Close();
}

}  // namespace plumb::testing
