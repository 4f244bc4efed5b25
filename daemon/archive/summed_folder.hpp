// SPDX-License-Identifier: Apache-2.0
// Exported folders: the files, their checksums (SHA256SUMS, in the format of `sha256sum -c`), and a
// JSON description. A folder whose name ends in ".tar" is one file, an archive of the same. For
// recipients the archive is encrypted as a whole, an age file whose name ends in ".age".
//
// What Plumb 0.2.0 has encrypted is still read: a folder or an archive of encrypted files, whose
// sums are signed with the key.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "algo/base/message.hpp"
#include "daemon/archive/age_file.hpp"
#include "daemon/archive/file_cipher.hpp"
#include "daemon/archive/tar_file.hpp"
#include "daemon/files/atomic_folder.hpp"

namespace plumb {

inline constexpr const char* kSumsFile = "SHA256SUMS";

/// A kind of folder. `may_hold` decides whether a path in it can be one of its files.
struct SummedKind {
  const char* name;        ///< For messages: "backup".
  const char* about_file;  ///< "backup.json"
  int format;
  std::function<bool(const std::string& path)> may_hold;
};

/// What opens an encrypted backup or export; borrowed.
struct BackupKeys {
  const AgeIdentity* identity = nullptr;
  const BackupSecret* secret = nullptr;  ///< Of Plumb 0.2.0.
};

/// Where an output for these recipients goes: "plumb" and "plumb.tar" become "plumb.tar.age".
/// Without recipients, and with a name that ends in ".age", as it is.
[[nodiscard]] std::filesystem::path EncryptedName(std::filesystem::path target,
                                                  const AgeRecipients& recipients);

/// Regular files in a folder, relative to `top`, by path. @throws IoError
[[nodiscard]] std::vector<std::string> FilesBelow(const std::filesystem::path& top,
                                                  const std::filesystem::path& folder);

/// Follows an archive that is being written.
struct ArchiveTap {
  TarStreamTake take = {};                   ///< Each piece, before it is encrypted.
  std::function<void()> before_commit = {};  ///< Once all is written. May throw: nothing appears.
};

/// A folder or an archive that is being written. It appears with Commit(), or not at all.
class SummedWriter {
 public:
  /// @param target  As from EncryptedName().
  /// @param recipients  None: nothing is encrypted.
  /// @throws InvalidRequest without recipients for a target that ends in ".age"; IoError
  SummedWriter(const std::filesystem::path& target, const SummedKind& kind, OutputKind output,
               const AgeRecipients& recipients, std::stop_token stop, ArchiveTap tap = {});

  /// Copies a file of another folder. Returns the digest of its content; nothing if it cannot be
  /// read or named, which is then reported as a problem.
  /// @throws IoError if it cannot be written
  std::string Add(const std::filesystem::path& from, const std::string& path);
  /// Copies a file that must exist. @throws IoError
  void AddOwn(const std::filesystem::path& from, const std::string& path);
  void Report(Message problem);
  /// Writes the sums and `about`, to which it adds its own facts. @throws IoError
  void Commit(nlohmann::ordered_json about);

  [[nodiscard]] std::size_t files() const { return files_; }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }  ///< Before encryption.
  [[nodiscard]] const std::vector<Message>& problems() const { return problems_; }

 private:
  TarWriter::Added Copied(const std::filesystem::path& from, const std::string& path);

  SummedKind kind_;
  AtomicFolder output_;
  std::unique_ptr<TarWriter> tar_;
  std::stop_token stop_;
  ArchiveTap tap_;
  std::string sums_;
  std::size_t files_ = 0;
  std::uint64_t bytes_ = 0;
  std::vector<Message> problems_;
};

/// A folder or an archive that is being read; it is not trusted.
class SummedReader {
 public:
  /// Reads the facts about it; an age file is decrypted as a whole.
  /// @param scratch  Existing folder on a disk with room for what is decrypted (Decrypted()).
  /// @throws DataError naming the folder: not of this kind, made by a newer Plumb, sums changed,
  ///         encrypted and not opened by the keys, or not encrypted though a key is given; IoError
  SummedReader(std::filesystem::path folder, SummedKind kind, const BackupKeys& keys,
               const std::filesystem::path& scratch, const std::stop_token& stop);

  [[nodiscard]] const std::vector<FileDigest>& files() const { return files_; }
  [[nodiscard]] const std::string& digest() const { return digest_; }  ///< Of SHA256SUMS.
  /// Compares every file with its sum. @throws DataError naming the first that is damaged
  void Verify(const std::stop_token& stop) const;
  /// Copies one file, decrypted, and returns the facts of the result.
  /// @throws DataError if it has changed; IoError if it cannot be written
  FileDigest CopyTo(const std::filesystem::path& to, const FileDigest& file,
                    const std::stop_token& stop) const;
  [[noreturn]] void Fail(Message why) const;

 private:
  void OpenArchive(const BackupKeys& keys, const std::filesystem::path& scratch,
                   const std::stop_token& stop);
  [[nodiscard]] std::string Text(const char* name, std::size_t max_bytes) const;
  [[nodiscard]] FileDigest Digest(const std::string& path, const std::stop_token& stop) const;
  FileDigest CopyPlain(const std::filesystem::path& to, const std::string& path,
                       const std::stop_token& stop) const;
  FileCipher::Written Open(const std::filesystem::path& to, const std::string& path,
                           const std::stop_token& stop) const;

  std::filesystem::path folder_;
  SummedKind kind_;
  std::unique_ptr<TarReader> tar_;  ///< Null: it is a folder.
  std::unique_ptr<FileCipher> cipher_;
  std::vector<FileDigest> files_;
  std::string digest_;
};

}  // namespace plumb
