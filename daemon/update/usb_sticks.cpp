// SPDX-License-Identifier: Apache-2.0
#include "daemon/update/usb_sticks.hpp"

#include <fcntl.h>

#include <algorithm>
#include <system_error>
#include <utility>

#include "daemon/loop/give_way.hpp"
#include "daemon/update/bundle_check.hpp"
#include "daemon/update/bundle_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
// files of a stick that are examined; it may contain anything
constexpr std::size_t kMaxLookedAt = 4096;

template <typename See>
void ForEachEntry(const fs::path& folder, const See& see) {
  std::error_code error;
  std::size_t left = kMaxLookedAt;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end && left > 0;
       entry.increment(error), --left)
    see(entry->path());
}

}  // namespace

std::vector<fs::path> UsbSticks::Files() const {
  std::vector<fs::path> files;
  ForEachEntry(root_, [&](const fs::path& stick) {
    ForEachEntry(stick, [&](const fs::path& file) {
      std::error_code error;
      if (files.size() < kMaxListedBundles && IsBundleName(file.filename().native()) &&
          fs::is_regular_file(fs::symlink_status(file, error)))
        files.push_back(file);
    });
  });
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<std::string> UsbSticks::Bundles() const {
  std::vector<std::string> names;
  for (const fs::path& file : Files()) names.push_back(file.filename().string());
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

int UsbSticks::Open(const std::string& name) const {
  for (const fs::path& file : Files()) {
    if (file.filename() == name)
      return ::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
  }
  return -1;
}

StickWatch::StickWatch(EventLoop& loop, std::function<std::vector<std::string>()> look,
                       std::function<void()> changed)
    : loop_(loop), look_(std::move(look)), changed_(std::move(changed)) {
  (void)thread_.Post([] { GiveWayToScans(); });
}

std::vector<std::string> StickWatch::Bundles() {
  if (!is_looking_) {
    const auto looked = alive_.WhileAlive([this](const std::vector<std::string>& found) {
      is_looking_ = false;
      if (std::exchange(bundles_, found) != found) changed_();
    });
    is_looking_ = thread_.Post([look = look_, looked, &loop = loop_] {
      loop.Post("sticks", [looked, found = look()] { looked(found); });
    });
  }
  return bundles_;
}

}  // namespace plumb
