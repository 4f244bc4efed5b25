// SPDX-License-Identifier: Apache-2.0
// The public keys for which backups are encrypted.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace plumb {

/// True for a public key of age, "age1..." (X25519), whose checksum is right (no typing error) and
/// for which `age` can encrypt.
[[nodiscard]] bool IsAgeRecipient(const std::string& text);

/// Those who can open what is encrypted. None: it is not encrypted.
class AgeRecipients {
 public:
  static constexpr std::size_t kMost = 16;

  AgeRecipients() = default;
  /// @throws DataError naming the first that is no public key, or if there are too many
  explicit AgeRecipients(std::vector<std::string> keys);
  /// One in each line; empty lines and those that begin with # are comments, as for `age -R`.
  /// @throws DataError as above, or if it holds none; IoError
  [[nodiscard]] static AgeRecipients FromFile(const std::filesystem::path& file);

  [[nodiscard]] bool empty() const { return keys_.empty(); }
  [[nodiscard]] const std::vector<std::string>& keys() const { return keys_; }
  bool operator==(const AgeRecipients&) const = default;

 private:
  std::vector<std::string> keys_;
};

}  // namespace plumb
