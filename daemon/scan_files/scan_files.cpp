// SPDX-License-Identifier: Apache-2.0
#include "daemon/scan_files/scan_files.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include <fmt/format.h>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "drivers/files/descriptor.hpp"
#include "words/file.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void FailToRead(const fs::path& path, int error) {
  throw IoError(say::file::CannotRead(path.string(), std::strerror(error)));
}

/// The files in a folder of the scan, by path; empty if it does not exist.
std::vector<std::string> FilesIn(const fs::path& folder, const char* name) {
  std::vector<std::string> files;
  std::error_code error;
  const fs::path top = folder / name;
  fs::recursive_directory_iterator entry(top, error);
  if (error == std::errc::no_such_file_or_directory) return files;
  for (const fs::recursive_directory_iterator end; !error && entry != end; entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_regular_file(ignored)) files.push_back(entry->path().lexically_relative(folder));
  }
  if (error) FailToRead(top, error.value());
  std::sort(files.begin(), files.end());
  return files;
}

/// @param what  The file as a person may read it.
Message Difference(const Message& what, const FileLook& look, const FileDigest& file) {
  const bool is_recording = file.path == kRecordingFolder;
  if (look.error == ENOENT)
    return look.is_link ? say::file::IsDeadLink(what) : say::file::IsMissing(what);
  if (look.error != 0) return say::file::IsUnreadable(what, std::strerror(look.error));
  if (is_recording) return look.is_folder ? Message() : say::file::IsNoFolder(what);
  if (!look.is_file) return look.is_folder ? say::file::IsFolder(what) : say::file::IsNoFile(what);
  if (!file.sha256.empty() && look.bytes != file.bytes)
    return say::file::OtherSize(what, look.bytes, file.bytes);
  return {};
}

}  // namespace

FileLook LookAt(const fs::path& path) {
  FileLook look;
  const Descriptor file = OpenForReading(path);
  struct stat status {};
  if (file.get() < 0 || ::fstat(file.get(), &status) != 0) {
    look.error = errno;
    struct stat link {};
    look.is_link = ::lstat(path.c_str(), &link) == 0 && S_ISLNK(link.st_mode);
    return look;
  }
  look.is_file = S_ISREG(status.st_mode);
  look.is_folder = S_ISDIR(status.st_mode);
  look.bytes = static_cast<std::uint64_t>(status.st_size);
  return look;
}

FileDigest DigestOfFile(const fs::path& folder, const std::string& path,
                        const std::stop_token& stop) {
  FileSum sum = SumOfFile(folder / path, stop);
  return {.path = path, .bytes = sum.bytes, .sha256 = std::move(sum.sha256)};
}

std::vector<FileDigest> DigestsOfScan(const fs::path& folder, const std::stop_token& stop) {
  std::vector<FileDigest> digests;
  for (const char* part : {"result", "scene"}) {
    for (const std::string& file : FilesIn(folder, part))
      digests.push_back(DigestOfFile(folder, file, stop));
  }
  return digests;
}

std::optional<FileDigest> DigestOfRecording(const fs::path& folder, const std::stop_token& stop) {
  const std::vector<std::string> files = FilesIn(folder, kRecordingFolder);
  if (files.empty()) return std::nullopt;
  Sha256 hash;
  FileDigest all{.path = kRecordingFolder};
  for (const std::string& file : files) {
    const FileDigest one = DigestOfFile(folder, file, stop);
    const std::string line = fmt::format("{}  {}\n", one.sha256, one.path);
    hash.Add(line.data(), line.size());
    all.bytes += one.bytes;
  }
  all.sha256 = hash.Hex();
  return all;
}

Message WhyNotThere(const fs::path& folder, const std::vector<FileDigest>& files,
                    const ExaminePath& look) {
  // Without its folder a scan has lost every file, so that is reported instead of the first file's
  // name.
  if (const FileLook found = look(folder); found.error != 0 || !found.is_folder) {
    const Message what = say::file::ItsFolder();
    return found.error == 0 ? say::file::IsNoFolder(what) : Difference(what, found, {.path = {}});
  }
  for (const FileDigest& file : files) {
    Message why = Difference(Message::Verbatim(file.path), look(folder / file.path), file);
    if (!why.empty()) return why;
  }
  return {};
}

Message WhyNotIntact(const fs::path& folder, const std::vector<FileDigest>& files,
                     std::string_view prefix, const std::stop_token& stop) {
  for (const FileDigest& file : files) {
    if (!std::string_view(file.path).starts_with(prefix)) continue;
    const Message what = Message::Verbatim(file.path);
    if (Message why = Difference(what, LookAt(folder / file.path), file); !why.empty()) return why;
    try {
      const std::optional<FileDigest> now = file.path == kRecordingFolder
                                                ? DigestOfRecording(folder, stop)
                                                : DigestOfFile(folder, file.path, stop);
      if (!now) return say::file::IsEmpty(what);
      if (now->sha256 != file.sha256 || now->bytes != file.bytes)
        return say::file::WasChanged(what);
    } catch (const IoError& error) {
      return say::file::IsUnusable(what, error.message());
    }
  }
  return {};
}

}  // namespace plumb
