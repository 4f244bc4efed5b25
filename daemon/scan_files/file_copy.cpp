// SPDX-License-Identifier: Apache-2.0
#include "daemon/scan_files/file_copy.hpp"

#include <fcntl.h>
#include <linux/fs.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <vector>

#include <fmt/format.h>

#include "algo/base/check_stop.hpp"
#include "drivers/files/descriptor.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

void MakeFolders(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw IoError(DescribeWriteError(folder, error.value()));
}

[[noreturn]] void FailToCopy(const fs::path& path, int error) {
  throw SourceUnreadable(fmt::format("cannot read {}: {}", path.string(), std::strerror(error)));
}

fs::path InMadeFolders(const fs::path& file) {
  MakeFolders(file.parent_path());
  return file;
}

}  // namespace

DigestingWriter::DigestingWriter(const fs::path& folder, const std::string& path)
    : target_(InMadeFolders(folder / path)), copy_(target_), digest_{.path = path} {}

void DigestingWriter::Write(std::span<const std::uint8_t> bytes) {
  hash_.Add(bytes.data(), bytes.size());
  copy_.Write(bytes);
  digest_.bytes += bytes.size();
}

FileDigest DigestingWriter::Close() {
  copy_.Close();
  ::chmod(target_.c_str(), 0640);
  digest_.sha256 = hash_.Hex();
  return digest_;
}

FileDigest Copy(const fs::path& from, const fs::path& to, const std::string& path,
                const std::stop_token& stop) {
  const fs::path source = from / path;
  const Descriptor file(::open(source.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  struct stat status {};
  if (file.get() < 0 || ::fstat(file.get(), &status) != 0) FailToCopy(source, errno);
  if (!S_ISREG(status.st_mode)) FailToCopy(source, EINVAL);
  DigestingWriter copy(to, path);
  std::vector<std::uint8_t> buffer(std::size_t{256} << 10);
  for (;;) {
    CheckStop(stop);
    const ssize_t count = ::read(file.get(), buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) FailToCopy(source, errno);
    if (count == 0) break;
    copy.Write({buffer.data(), static_cast<std::size_t>(count)});
  }
  return copy.Close();
}

namespace {

/// False if the file system cannot share them. Other errors are left to the copy to report.
bool Clone(const fs::path& from, const fs::path& to) {
  const Descriptor source(::open(from.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  if (source.get() < 0) return false;
  const Descriptor target(::open(to.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0640));
  if (target.get() < 0) return false;
  const bool done = ::ioctl(target.get(), FICLONE, source.get()) == 0;
  if (!done) ::unlink(to.c_str());
  return done;
}

}  // namespace

FileDigest CloneOrCopy(const fs::path& from, const fs::path& to, const std::string& path,
                       const std::stop_token& stop) {
  const fs::path target = to / path;
  MakeFolders(target.parent_path());
  if (!Clone(from / path, target)) return Copy(from, to, path, stop);
  try {
    return DigestOfFile(to, path, stop);
  } catch (const IoError& error) {
    ::unlink(target.c_str());
    throw SourceUnreadable(error.what());
  }
}

void PlaceFile(const fs::path& folder, const std::string& name, const std::string& text) {
  const fs::path file = folder / name, temporary = folder / ("." + name + ".new");
  ::unlink(temporary.c_str());  // as root, a link that the folder's owner placed is not followed
  WriteWholeFile(temporary, std::string_view(text));
  struct stat owner {};
  if (::stat(folder.c_str(), &owner) != 0 ||
      (::geteuid() == 0 && ::lchown(temporary.c_str(), owner.st_uid, owner.st_gid) != 0))
    throw IoError(DescribeWriteError(temporary, errno));
  SyncToDisk(temporary);
  if (::rename(temporary.c_str(), file.c_str()) != 0)
    throw IoError(DescribeWriteError(file, errno));
  SyncToDisk(folder);
}

void GiveToOwnerOf(const fs::path& state, const fs::path& written) {
  struct stat owner {};
  if (::geteuid() != 0 || ::stat(state.c_str(), &owner) != 0 || owner.st_uid == 0) return;
  const auto give = [&owner](const fs::path& path) {
    if (::lchown(path.c_str(), owner.st_uid, owner.st_gid) != 0)
      throw IoError(DescribeWriteError(path, errno));
  };
  give(written);
  if (!fs::is_directory(fs::symlink_status(written))) return;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(written))
    give(entry.path());
}

bool IsBelow(const fs::path& path, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first ==
         folder.end();
}

}  // namespace plumb
