// SPDX-License-Identifier: Apache-2.0
// Checksums of what is stored.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>

#include <sodium/crypto_hash_sha256.h>

namespace plumb {

/// SHA-256 of the added data, in hexadecimal.
class Sha256 {
 public:
  Sha256();
  void Add(const void* bytes, std::size_t count);
  [[nodiscard]] std::string Hex();  ///< Call it once.

 private:
  crypto_hash_sha256_state state_{};
};

/// Two digits for each byte.
[[nodiscard]] std::string HexOf(std::span<const unsigned char> bytes);
[[nodiscard]] std::string Sha256Of(std::string_view text);

struct FileSum {
  std::uint64_t bytes = 0;
  std::string sha256;  ///< Hexadecimal.
};

/// Of a regular file, read in pieces.
/// @throws IoError if it cannot be read.
/// @throws Interrupted on a stop request.
[[nodiscard]] FileSum SumOfFile(const std::filesystem::path& file,
                                const std::stop_token& stop = {});

}  // namespace plumb
