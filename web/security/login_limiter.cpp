#include "web/security/login_limiter.hpp"

#include <algorithm>

namespace plumb::web {
namespace {

constexpr std::size_t kMaxFailures = 5;
constexpr std::chrono::seconds kWindow{60};
constexpr std::size_t kMaxKeys = 1024;

}  // namespace

std::chrono::seconds LoginLimiter::Wait(const std::string& key, TimePoint now) const {
  const auto found = failures_.find(key);
  if (found == failures_.end() || found->second.size() < kMaxFailures)
    return std::chrono::seconds(0);
  const auto open_at = found->second[found->second.size() - kMaxFailures] + kWindow;
  return now >= open_at ? std::chrono::seconds(0)
                        : std::chrono::ceil<std::chrono::seconds>(open_at - now);
}

void LoginLimiter::Failed(const std::string& key, TimePoint now) {
  if (failures_.size() >= kMaxKeys && !failures_.contains(key)) {
    failures_.erase(std::min_element(
        failures_.begin(), failures_.end(),
        [](const auto& a, const auto& b) { return a.second.back() < b.second.back(); }));
  }
  std::deque<TimePoint>& times = failures_[key];
  times.push_back(now);
  if (times.size() > kMaxFailures) times.pop_front();
}

}  // namespace plumb::web
