// SPDX-License-Identifier: Apache-2.0
// Slows down password guessing.
#pragma once

#include <chrono>
#include <deque>
#include <map>
#include <string>

namespace plumb::web {

/// At most a number of failures a minute for one key (an address, or an account's name). The memory
/// is bounded, and no flood of other keys makes it forget one that is slowed down: what it forgets
/// first is over, then what failed least.
class LoginLimiter {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  static constexpr std::size_t kMaxFailures = 5;

  /// Seconds to wait; 0: proceed. @param most  Failures a minute; the same for all calls of a key.
  [[nodiscard]] std::chrono::seconds Wait(const std::string& key, TimePoint now,
                                          std::size_t most = kMaxFailures) const;
  void Failed(const std::string& key, TimePoint now, std::size_t most = kMaxFailures);
  void Succeeded(const std::string& key) { failures_.erase(key); }
  /// The newest failure was none: what was tried could not be checked.
  void TakeBack(const std::string& key);

 private:
  void MakeRoom(TimePoint now);

  std::map<std::string, std::deque<TimePoint>> failures_;
};

}  // namespace plumb::web
