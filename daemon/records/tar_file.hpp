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
#include <span>
#include <stop_token>
#include <string>

#include "daemon/records/scan_files.hpp"
#include "drivers/files/descriptor.hpp"

struct archive;

namespace plumb {

/// True for the names of files that are archives: those that end in ".tar".
[[nodiscard]] bool IsTarName(const std::filesystem::path& path);

/// Plain path of a file in folders, without "..", ".", empty parts or control characters.
[[nodiscard]] bool IsPlainPath(const std::string& path);

/// Writes an archive, for its owner alone. Not flushed to the disk.
class TarWriter {
 public:
  /// @throws IoError
  explicit TarWriter(std::filesystem::path file);
  ~TarWriter();
  TarWriter(const TarWriter&) = delete;
  TarWriter& operator=(const TarWriter&) = delete;

  /// Appends the file `from`/`path` as `path`. @throws IoError; Interrupted
  void Add(const std::filesystem::path& from, const std::string& path, const std::stop_token& stop);
  /// Writes the end of the archive. @throws IoError
  void Close();

 private:
  /// The output of libarchive, which leaks memory if it learns of a failed write. Errors are
  /// therefore kept here, where Check() reports them, and what follows is discarded.
  struct Sink {
    int fd = -1;
    int error = 0;
    void Take(const std::uint8_t* bytes, std::size_t count);
  };
  void Check(int result) const;

  std::filesystem::path file_;
  Sink sink_;
  archive* archive_ = nullptr;
};

/// Reads files of an archive, in any order. Not thread-safe.
class TarReader {
 public:
  /// Reads the names of all files. @throws DataError with the reason why it is refused
  explicit TarReader(std::filesystem::path file);

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
