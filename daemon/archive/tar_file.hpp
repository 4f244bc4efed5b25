// SPDX-License-Identifier: Apache-2.0
// Tar archives of plain files: what a folder would hold, in one file.
//
// What is read is not trusted: regular files with plain paths only, each once, none beyond the end
// of the archive, and nothing compressed or sparse, so that an archive is never longer unpacked
// than packed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>

#include "algo/base/message.hpp"
#include "daemon/archive/age_file.hpp"
#include "daemon/files/age_recipients.hpp"
#include "daemon/scan_files/scan_files.hpp"
#include "drivers/files/descriptor.hpp"

struct archive;

namespace plumb {

/// True for the names of files that are archives: those that end in ".tar" or ".age".
[[nodiscard]] bool IsTarName(const std::filesystem::path& path);

/// Plain path of a file in folders, without "..", ".", empty parts or control characters.
[[nodiscard]] bool IsPlainPath(const std::string& path);

using TarStreamTake = std::function<void(std::span<const std::uint8_t>)>;

/// Reads an archive from its beginning to the end of the input, which may be a socket.
/// @param begin  Called with path and length of each file; what it returns takes the content.
/// @throws DataError with the reason why it is refused; Interrupted
void ReadTarStream(
    int input, const std::stop_token& stop,
    const std::function<TarStreamTake(const std::string& path, std::uint64_t bytes)>& begin);

/// Writes an archive, for its owner alone. Not flushed to the disk.
class TarWriter {
 public:
  /// @param recipients  Not empty: the archive is encrypted for them before it reaches the disk.
  /// @param tee  Also gets the archive, before it is encrypted.
  /// @throws IoError
  explicit TarWriter(std::filesystem::path file, const AgeRecipients& recipients = {},
                     TarStreamTake tee = {});
  ~TarWriter();
  TarWriter(const TarWriter&) = delete;
  TarWriter& operator=(const TarWriter&) = delete;

  /// What was written. If the original could not be read to its end, zeros are in place of the
  /// rest.
  struct Added {
    FileDigest digest;
    Message problem;  ///< Empty if there was none.
  };
  /// Appends the file `from`/`path` as `path`.
  /// @throws SourceUnreadable if nothing of it can be read, and nothing was written; IoError;
  ///         Interrupted
  Added Add(const std::filesystem::path& from, const std::string& path,
            const std::stop_token& stop);
  /// Appends a text as a file. @throws IoError
  void AddText(const std::string& path, std::string_view text);
  /// Writes the end of the archive. @throws IoError
  void Close();

 private:
  /// The output of libarchive, which leaks memory if it learns of a failed write. Errors are
  /// therefore kept here, where Check() reports them, and what follows is discarded.
  struct Sink {
    std::filesystem::path file;
    std::unique_ptr<Descriptor> fd;
    std::unique_ptr<AgeWriter> age;  ///< Null: nothing is encrypted.
    TarStreamTake tee;
    bool is_closed = false;  ///< Nothing is written any more.
    std::optional<Message> error = {};
    void Take(std::span<const std::uint8_t> bytes);
  };
  void Check(int result) const;
  void Begin(const std::string& path, std::int64_t bytes);
  void Put(std::span<const std::uint8_t> bytes);

  Sink sink_;
  archive* archive_ = nullptr;
};

/// Reads files of an archive, in any order. Not thread-safe.
class TarReader {
 public:
  /// Reads the names of all files. @throws DataError with the reason why it is refused
  explicit TarReader(std::filesystem::path file);
  /// The same of an open file. @param name  For messages.
  TarReader(Descriptor file, std::filesystem::path name);

  /// Position and length of each file, by path.
  struct Entry {
    std::int64_t header = 0;
    std::uint64_t bytes = 0;
  };
  [[nodiscard]] const std::map<std::string, Entry>& entries() const { return entries_; }

  /// @throws DataError if there is no such file, it is longer or cannot be read
  [[nodiscard]] std::string Text(const std::string& path, std::size_t max_bytes) const;
  /// As DigestOfFile(). @throws SourceUnreadable; Interrupted
  [[nodiscard]] FileDigest Digest(const std::string& path, const std::stop_token& stop) const;
  /// As Copy() of file_copy.hpp. @throws SourceUnreadable; IoError; Interrupted
  FileDigest CopyTo(const std::filesystem::path& to, const std::string& path,
                    const std::stop_token& stop) const;

 private:
  using Take = std::function<void(std::span<const std::uint8_t>)>;
  void ReadNames();
  void Read(const std::string& path, const Take& take) const;

  std::filesystem::path file_;
  Descriptor fd_;
  std::map<std::string, Entry> entries_;
};

}  // namespace plumb
