// SPDX-License-Identifier: Apache-2.0
// Files of the format https://age-encryption.org/v1, by Debian's program `age` as a helper.
//
// It is found along PATH, gets its input and output as open files, no environment, no terminal and
// no shell, and is killed with the thread that started it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "daemon/files/age_recipients.hpp"
#include "drivers/files/descriptor.hpp"

namespace plumb {

/// A private key that opens what was encrypted for its public key. Erased on destruction.
class AgeIdentity {
 public:
  /// Reads a file as `age-keygen` writes it. @throws DataError if it holds none, or one that an
  /// editor has put a byte order mark or blanks around; IoError
  explicit AgeIdentity(const std::filesystem::path& file);
  ~AgeIdentity();
  AgeIdentity(const AgeIdentity&) = delete;
  AgeIdentity& operator=(const AgeIdentity&) = delete;

  [[nodiscard]] const std::string& text() const { return text_; }
  /// The public keys, computed by `age-keygen`. @throws DataError if it refuses; IoError
  [[nodiscard]] std::vector<std::string> Recipients() const;

 private:
  std::string text_;
};

/// True for a file that begins as every age file begins.
[[nodiscard]] bool IsAgeFile(const std::filesystem::path& file);

class HelperProcess;

/// Encrypts what is written into an open file.
class AgeWriter {
 public:
  /// @param output  Borrowed; outlives this object.
  /// @throws IoError if `age` is missing or cannot be run
  AgeWriter(const AgeRecipients& recipients, int output);
  ~AgeWriter();  ///< Without Close(), `age` is killed.
  AgeWriter(const AgeWriter&) = delete;
  AgeWriter& operator=(const AgeWriter&) = delete;

  /// @throws IoError with the words of `age`
  void Write(std::span<const std::uint8_t> bytes);
  /// Waits for the end of the output. @throws IoError
  void Close();

 private:
  [[noreturn]] void FailAsAge();

  std::unique_ptr<HelperProcess> process_;
  std::unique_ptr<Descriptor> input_;
};

/// Decrypts a file into one without a name in the folder `scratch`, which vanishes when it is
/// closed; it is as large as the encrypted one.
/// @throws DataError with the words of `age` if the identity does not open it, or it is damaged;
///         IoError if `age` is missing, or the disk is full; Interrupted
[[nodiscard]] Descriptor Decrypted(const std::filesystem::path& file, const AgeIdentity& identity,
                                   const std::filesystem::path& scratch,
                                   const std::stop_token& stop);

}  // namespace plumb
