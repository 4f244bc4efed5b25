// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/kept_pages.hpp"

#include <cstring>
#include <map>

namespace plumb {

std::shared_ptr<KeptPages> KeptPages::Of(const std::string& file) {
  static std::mutex mutex;
  static std::map<std::string, std::weak_ptr<KeptPages>> all;
  const std::lock_guard lock(mutex);
  std::erase_if(all, [](const auto& kept) { return kept.second.expired(); });
  std::weak_ptr<KeptPages>& known = all[file];
  std::shared_ptr<KeptPages> kept = known.lock();
  if (!kept) known = kept = std::make_shared<KeptPages>();
  return kept;
}

bool KeptPages::Get(std::int64_t offset, void* page) const {
  const std::lock_guard lock(mutex_);
  const auto found = pages_.find(offset);
  if (found == pages_.end()) return false;
  std::memcpy(page, found->second->data(), kPageBytes);
  return true;
}

void KeptPages::Put(std::int64_t offset, const void* page) {
  const std::lock_guard lock(mutex_);
  auto found = pages_.find(offset);
  if (found == pages_.end()) {
    if (pages_.size() >= kMost / kPageBytes) return;
    found = pages_.emplace(offset, std::make_unique<std::array<std::uint8_t, kPageBytes>>()).first;
  }
  std::memcpy(found->second->data(), page, kPageBytes);
}

void KeptPages::Drop(std::int64_t offset) {
  const std::lock_guard lock(mutex_);
  pages_.erase(offset);
}

void KeptPages::DropFrom(std::int64_t offset) {
  const std::lock_guard lock(mutex_);
  std::erase_if(pages_, [offset](const auto& page) { return page.first >= offset; });
}

}  // namespace plumb
