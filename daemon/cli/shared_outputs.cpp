// SPDX-License-Identifier: Apache-2.0
#include "daemon/cli/shared_outputs.hpp"

#include <fcntl.h>
#include <sys/file.h>

#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <vector>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "daemon/cli/common_options.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// Between two looks at items that another process is doing, which takes seconds to minutes.
constexpr std::chrono::milliseconds kLookAgain{200};

fs::path LockFile(const fs::path& folder, const std::string& name) {
  EnsureFolder(folder / ".locks");
  return folder / ".locks" / name;
}

/// Of the hidden name that AtomicFolder and WriteFileAtomically() give to what they write; empty of
/// any other.
std::string OutputOfHidden(const std::string& hidden) {
  const std::size_t end = hidden.find(".plumb-");
  return hidden.starts_with('.') && end != std::string::npos ? hidden.substr(1, end - 1)
                                                             : std::string();
}

}  // namespace

OutputLock::OutputLock(const fs::path& folder, const std::string& name)
    : file_(
          ::open(LockFile(folder, name).c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666)) {
  if (file_.get() < 0) throw IoError(DescribeWriteError(LockFile(folder, name), errno));
  int result = 0;
  do {
    result = ::flock(file_.get(), LOCK_EX | LOCK_NB);
  } while (result != 0 && errno == EINTR);
  if (result != 0 && errno != EWOULDBLOCK)
    throw IoError(DescribeWriteError(LockFile(folder, name), errno));
  is_held_ = result == 0;
}

void WaitForOthers(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any stopped;
  std::unique_lock lock(mutex);
  stopped.wait_for(lock, stop, kLookAgain, [] { return false; });
  CheckStop(stop);
}

void RemoveUnfinished(const fs::path& folder) {
  try {
    std::vector<fs::path> hidden;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder))
      if (!OutputOfHidden(entry.path().filename().string()).empty()) hidden.push_back(entry.path());
    for (const fs::path& path : hidden) {
      const OutputLock lock(folder, OutputOfHidden(path.filename().string()));
      if (lock.IsHeld()) fs::remove_all(path);
    }
  } catch (const fs::filesystem_error& error) {
    throw IoError(DescribeWriteError(folder, error.code().value()));
  }
}

}  // namespace plumb
