// Slows down password guessing.
#pragma once

#include <chrono>
#include <deque>
#include <map>
#include <string>

namespace plumb::web {

/// At most five failures a minute for one key (an address, or an account's name).
class LoginLimiter {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  /// Seconds to wait; 0: proceed.
  [[nodiscard]] std::chrono::seconds Wait(const std::string& key, TimePoint now) const;
  void Failed(const std::string& key, TimePoint now);
  void Succeeded(const std::string& key) { failures_.erase(key); }

 private:
  std::map<std::string, std::deque<TimePoint>> failures_;
};

}  // namespace plumb::web
