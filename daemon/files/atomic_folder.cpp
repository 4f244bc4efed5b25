// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/atomic_folder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <string>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "words/output.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::minutes kStaleAge{
    1};                                 // covers the time between creating a folder and locking it
constexpr std::size_t kMaxFsyncs = 64;  // above this number, one sync of the file system is cheaper

/// Absolute, without trailing slash, with links to folders resolved.
fs::path Normalised(const fs::path& target) {
  fs::path path = fs::absolute(target).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();
  std::error_code error;
  if (fs::is_symlink(path, error)) {
    const fs::path real = fs::canonical(path, error);
    if (!error) return real;
  }
  return path;
}

std::string HiddenPrefix(const fs::path& target) {
  return fmt::format(".{}.plumb-", target.filename().string());
}

void SyncTree(const fs::path& folder) {
  std::vector<fs::path> paths;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
    paths.push_back(entry.path());
  if (paths.size() > kMaxFsyncs) {
    SyncWholeDisk(folder);
    return;
  }
  for (const fs::path& path : paths) SyncToDisk(path);
  SyncToDisk(folder);
}

void CheckReplaceable(const fs::path& target, const OutputKind& kind) {
  const fs::file_status status = fs::symlink_status(target);
  if (!fs::exists(status)) return;
  if (kind.may_replace) {
    if (fs::is_regular_file(status) && kind.may_replace(target)) return;
    throw IoError(say::output::NoOlderOne(kind.name, target.string()));
  }
  if (!fs::is_directory(status)) {
    throw IoError(say::output::IsAFile(kind.name, target.string()));
  }
  bool has_marker = false;
  for (const fs::directory_entry& entry : fs::directory_iterator(target)) {
    const std::string name = entry.path().filename().string();
    if (std::find(kind.known_entries.begin(), kind.known_entries.end(), name) ==
        kind.known_entries.end()) {
      throw IoError(say::output::ForeignEntry(kind.name, target.string(), name));
    }
    has_marker = has_marker || name == kind.marker_file;
  }
  if (!has_marker && !fs::is_empty(target)) {
    throw IoError(say::output::NoMarker(kind.name, target.string(), kind.marker_file));
  }
}

/// Exchanges the two folders in one step if the file system can; otherwise the old one is removed
/// first.
void Replace(const fs::path& hidden, const fs::path& target) {
  if (::rename(hidden.c_str(), target.c_str()) == 0) return;  // nothing there, or an empty folder
  if (errno != ENOTEMPTY && errno != EEXIST) throw IoError(DescribeWriteError(target, errno));
  if (::renameat2(AT_FDCWD, hidden.c_str(), AT_FDCWD, target.c_str(), RENAME_EXCHANGE) != 0) {
    const fs::path old = hidden.string() + "-old";
    if (::rename(target.c_str(), old.c_str()) != 0)
      throw IoError(DescribeWriteError(target, errno));
    if (::rename(hidden.c_str(), target.c_str()) != 0) {
      const int error = errno;
      (void)::rename(old.c_str(), target.c_str());
      throw IoError(DescribeWriteError(target, error));
    }
    if (::rename(old.c_str(), hidden.c_str()) != 0) throw IoError(DescribeWriteError(old, errno));
  }
  // the new output is in place; remains of the old one under the hidden name are removed later
  std::error_code ignored;
  fs::remove_all(hidden, ignored);
}

std::string UniqueSuffix() {
  static std::atomic<unsigned> counter{0};
  return fmt::format("{}-{}", ::getpid(), counter.fetch_add(1));
}

}  // namespace

AtomicFolder::AtomicFolder(const fs::path& target, OutputKind kind)
    : kind_(std::move(kind)), target_(Normalised(target)) {
  try {
    CheckReplaceable(target_, kind_);
    for (fs::path parent = target_.parent_path(); !fs::exists(parent);
         parent = parent.parent_path()) {
      made_parents_.insert(made_parents_.begin(), parent);
    }
    fs::create_directories(target_.parent_path());
    RemoveStale();
    MakeHidden();
  } catch (const fs::filesystem_error& error) {
    Discard();
    throw IoError(DescribeWriteError(target_, error.code().value()));
  } catch (...) {
    Discard();
    throw;
  }
}

void AtomicFolder::MakeHidden() {
  int result = 0;
  do {
    hidden_ = target_.parent_path() / (HiddenPrefix(target_) + UniqueSuffix());
    result = ::mkdir(hidden_.c_str(), 0777);
  } while (result != 0 && errno == EEXIST);
  if (result != 0) throw IoError(DescribeWriteError(target_, errno));
  lock_ = ::open(hidden_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (lock_ < 0) throw IoError(DescribeWriteError(target_, errno));
  // without working locks, stale folders stay, which is harmless
  (void)::flock(lock_, LOCK_EX | LOCK_NB);
}

void AtomicFolder::RemoveStale() const {
  const std::string prefix = HiddenPrefix(target_);
  std::vector<fs::path> stale;
  for (const fs::directory_entry& entry : fs::directory_iterator(target_.parent_path())) {
    std::error_code error;
    const bool ours = entry.path().filename().string().starts_with(prefix) &&
                      entry.is_directory(error) && !entry.is_symlink(error);
    if (!ours || fs::file_time_type::clock::now() - entry.last_write_time(error) < kStaleAge ||
        error)
      continue;
    const int descriptor = ::open(entry.path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0) continue;
    if (::flock(descriptor, LOCK_EX | LOCK_NB) == 0) stale.push_back(entry.path());
    ::close(descriptor);
  }
  std::error_code ignored;
  for (const fs::path& path : stale) fs::remove_all(path, ignored);
}

AtomicFolder::~AtomicFolder() {
  if (lock_ >= 0) ::close(lock_);
  if (!committed_) Discard();
}

void AtomicFolder::Discard() {
  std::error_code ignored;
  if (!hidden_.empty()) fs::remove_all(hidden_, ignored);
  for (auto parent = made_parents_.rbegin(); parent != made_parents_.rend(); ++parent)
    ::rmdir(parent->c_str());  // removes only empty folders
}

void AtomicFolder::Commit() {
  try {
    SyncTree(hidden_);
    CheckReplaceable(target_, kind_);  // again, because time has passed
    Replace(hidden_, target_);
    committed_ = true;
    SyncToDisk(target_.parent_path());
  } catch (const fs::filesystem_error& error) {
    throw IoError(DescribeWriteError(target_, error.code().value()));
  }
}

void AtomicFolder::CommitFile(const fs::path& file) {
  SyncToDisk(file);
  try {
    CheckReplaceable(target_, kind_);  // again, because time has passed
  } catch (const fs::filesystem_error& error) {
    throw IoError(DescribeWriteError(target_, error.code().value()));
  }
  if (::rename(file.c_str(), target_.c_str()) != 0)
    throw IoError(DescribeWriteError(target_, errno));
  committed_ = true;
  std::error_code ignored;
  fs::remove_all(hidden_, ignored);
  SyncToDisk(target_.parent_path());
}

void WriteFileAtomically(const fs::path& target,
                         const std::function<void(const fs::path&)>& write) {
  const fs::path path = Normalised(target);
  std::error_code error;
  if (fs::is_directory(path, error)) {
    throw IoError(say::output::IsAFolder(path.string()));
  }
  const fs::path hidden =
      path.parent_path() / (HiddenPrefix(path) + UniqueSuffix() + path.extension().string());
  try {
    write(hidden);
    SyncToDisk(hidden);
    if (::rename(hidden.c_str(), path.c_str()) != 0) throw IoError(DescribeWriteError(path, errno));
    SyncToDisk(path.parent_path());
  } catch (...) {
    ::unlink(hidden.c_str());
    throw;
  }
}

}  // namespace plumb
