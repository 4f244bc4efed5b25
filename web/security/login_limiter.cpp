// SPDX-License-Identifier: Apache-2.0
#include "web/security/login_limiter.hpp"

#include <algorithm>
#include <utility>

namespace plumb::web {
namespace {

constexpr std::chrono::seconds kWindow{60};
constexpr std::size_t kMaxKeys = 16384;

}  // namespace

std::chrono::seconds LoginLimiter::Wait(const std::string& key, TimePoint now,
                                        std::size_t most) const {
  const auto found = failures_.find(key);
  if (found == failures_.end() || found->second.size() < most) return std::chrono::seconds(0);
  const auto open_at = found->second[found->second.size() - most] + kWindow;
  return now >= open_at ? std::chrono::seconds(0)
                        : std::chrono::ceil<std::chrono::seconds>(open_at - now);
}

void LoginLimiter::MakeRoom(TimePoint now) {
  if (failures_.size() < kMaxKeys) return;
  std::erase_if(failures_, [&](const auto& entry) { return now - entry.second.back() >= kWindow; });
  if (failures_.size() < kMaxKeys) return;
  failures_.erase(
      std::min_element(failures_.begin(), failures_.end(), [](const auto& a, const auto& b) {
        return std::pair(a.second.size(), a.second.back()) <
               std::pair(b.second.size(), b.second.back());
      }));
}

void LoginLimiter::Failed(const std::string& key, TimePoint now, std::size_t most) {
  if (!failures_.contains(key)) MakeRoom(now);
  std::deque<TimePoint>& times = failures_[key];
  times.push_back(now);
  if (times.size() > most) times.pop_front();
}

void LoginLimiter::TakeBack(const std::string& key) {
  const auto found = failures_.find(key);
  if (found == failures_.end()) return;
  found->second.pop_back();
  if (found->second.empty()) failures_.erase(found);
}

}  // namespace plumb::web
