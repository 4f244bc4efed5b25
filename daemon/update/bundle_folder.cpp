// SPDX-License-Identifier: Apache-2.0
#include "daemon/update/bundle_folder.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <exception>
#include <string_view>
#include <system_error>
#include <utility>

#include "algo/base/errors.hpp"
#include "daemon/update/bundle_check.hpp"
#include "drivers/files/file_io.hpp"
#include "words/update.hpp"

namespace plumb {

namespace {

constexpr std::size_t kMaxKept = 4;
constexpr std::string_view kEnding = ".raucb";

/// Keeps a file open and closes it on another thread if there is one, because freeing a large file
/// takes time.
class DeferredClose {
 public:
  DeferredClose(const std::filesystem::path& file,
                const BundleFolder::RunInBackground& run_in_background)
      : run_in_background_(run_in_background),
        fd_(::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK)) {}
  ~DeferredClose() {
    if (fd_ < 0) return;
    if (!run_in_background_ || !run_in_background_([fd = fd_] { ::close(fd); })) ::close(fd_);
  }
  DeferredClose(const DeferredClose&) = delete;
  DeferredClose& operator=(const DeferredClose&) = delete;

 private:
  const BundleFolder::RunInBackground& run_in_background_;
  int fd_;
};

}  // namespace

std::vector<std::string> BundleFolder::List() const {
  std::vector<std::string> names;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder_, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.ends_with(kEnding) && !name.starts_with('.') && names.size() < kMaxListedBundles)
      names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

bool BundleFolder::Has(const std::string& name) const {
  const std::vector<std::string> known = List();
  return std::find(known.begin(), known.end(), name) != known.end();
}

Change BundleFolder::Add(const std::filesystem::path& file, const std::string& name) const {
  if (const Message why = WhyNoBundle(file, max_bytes_, name); !why.empty())
    return Refused(ChangeResult::kInvalid, why);
  const std::vector<std::string> known = List();
  const bool is_known = std::find(known.begin(), known.end(), name) != known.end();
  if (!is_known && known.size() >= kMaxKept)
    return Refused(ChangeResult::kConflict, say::update::TooMany());
  // Otherwise a power cut soon after could leave the name without contents.
  try {
    SyncToDisk(file);
    if (::rename(file.c_str(), (folder_ / name).c_str()) != 0)
      throw IoError(DescribeWriteError(name, errno));
    SyncToDisk(folder_);
  } catch (const std::exception& error) {
    return Refused(ChangeResult::kNoSpace, MessageOf(error));
  }
  return {};
}

Change BundleFolder::Remove(const std::string& name) const {
  if (!Has(name)) return Refused(ChangeResult::kNotFound, say::update::NoSuchBundle());
  const Message why = Drop(folder_ / name);
  return why.empty() ? Change{} : Refused(ChangeResult::kFailed, why);
}

Message BundleFolder::Drop(const std::filesystem::path& file) const {
  const DeferredClose removed(file, run_in_background_);
  std::error_code error;
  std::filesystem::remove(file, error);
  return error ? say::update::NotRemoved(file.filename().string(), error.message()) : Message();
}

void BundleFolder::RemoveUnfinished() const {
  std::error_code error;
  std::vector<std::filesystem::path> broken;
  for (std::filesystem::directory_iterator entry(folder_, error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->path().filename().string().starts_with(".upload-")) broken.push_back(entry->path());
  }
  for (const std::filesystem::path& file : broken) std::filesystem::remove(file, error);
}

}  // namespace plumb
