// Folders that leave the appliance: files, SHA256SUMS of each as `sha256sum -c` reads it, and a
// JSON file about the whole. Encrypted where a key is given; the sums are then of what lies on the
// disk, and signed with the key.
#pragma once

#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "daemon/files/atomic_folder.hpp"
#include "daemon/records/file_cipher.hpp"

namespace plumb {

/// What kind of folder it is. Of a path within it `may_hold` says if it can be one of its files.
struct SummedKind {
  const char* name;        ///< For messages: "backup".
  const char* about_file;  ///< "backup.json"
  int format;
  std::function<bool(const std::string& path)> may_hold;
};

/// Plain path of files in folders, none of it "..", ".", empty or with control characters.
[[nodiscard]] bool IsPlainPath(const std::string& path);

/// Regular files below a folder, relative to `top`, by path. @throws IoError
[[nodiscard]] std::vector<std::string> FilesBelow(const std::filesystem::path& top,
                                                  const std::filesystem::path& folder);

/// One that is being written. It appears with Commit(), or not at all.
class SummedWriter {
 public:
  /// @param secret  Null: nothing is encrypted.
  SummedWriter(const std::filesystem::path& target, const SummedKind& kind, OutputKind output,
               const BackupSecret* secret, std::stop_token stop);

  /// Copies a file of another folder. Gives the digest of its content, or nothing where it cannot
  /// be read or named, which is a problem then. @throws IoError if it cannot be written
  std::string Add(const std::filesystem::path& from, const std::string& path);
  /// Copies one that must be there. @throws IoError
  void AddOwn(const std::filesystem::path& from, const std::string& path);
  void Report(std::string problem);
  /// Writes the sums and, with what it says itself, `about`. @throws IoError
  void Commit(nlohmann::ordered_json about);

  [[nodiscard]] std::size_t files() const { return files_; }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }  ///< Before encryption.
  [[nodiscard]] const std::vector<std::string>& problems() const { return problems_; }

 private:
  std::string Copied(const std::filesystem::path& from, const std::string& path);

  SummedKind kind_;
  AtomicFolder output_;
  std::unique_ptr<FileCipher> cipher_;
  std::stop_token stop_;
  std::string sums_;
  std::size_t files_ = 0;
  std::uint64_t bytes_ = 0;
  std::vector<std::string> problems_;
};

/// One that is read; not to be trusted.
class SummedReader {
 public:
  /// Reads what it says of itself. @throws DataError naming the folder: none of this kind, made by
  /// a newer Plumb, sums changed, encrypted and no secret or another one, or not encrypted though a
  /// secret is given
  SummedReader(std::filesystem::path folder, SummedKind kind, const BackupSecret* secret);

  [[nodiscard]] const std::vector<FileDigest>& files() const { return files_; }
  [[nodiscard]] const std::string& digest() const { return digest_; }  ///< Of SHA256SUMS.
  /// Holds every file against its sum. @throws DataError naming the first that is damaged
  void Verify(const std::stop_token& stop) const;
  /// Copies one, decrypted, and gives what it is then. @throws DataError if it is not what it was;
  /// IoError if it cannot be written
  FileDigest CopyTo(const std::filesystem::path& to, const FileDigest& file,
                    const std::stop_token& stop) const;
  [[noreturn]] void Fail(const std::string& why) const;

 private:
  std::filesystem::path folder_;
  SummedKind kind_;
  std::unique_ptr<FileCipher> cipher_;
  std::vector<FileDigest> files_;
  std::string digest_;
};

}  // namespace plumb
