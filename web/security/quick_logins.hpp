// SPDX-License-Identifier: Apache-2.0
// Which people may log in with a PIN or a badge, and in which browsers.
#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "algo/base/message.hpp"

namespace plumb::web {

inline constexpr std::size_t kMaxPin = 64;  ///< Bytes of a PIN or a badge.

/// Why this is neither a PIN (4 to 8 digits) nor the code of a badge (8 to 64 letters and digits),
/// or a row of digits; empty if it is one.
[[nodiscard]] Message WhyNotPin(const std::string& pin);

/// A log-in with the password opens this way for one shift in the browser that it came from; three
/// wrong PINs close it until the next one. Kept in memory only: a restart asks everybody for the
/// password.
class QuickLogIns {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  static constexpr std::chrono::hours kShift{10};
  static constexpr int kMaxTries = 3;

  /// @param device  As DeviceCookies::Identify() names the browser.
  void Open(const std::string& device, const std::string& user, TimePoint now);
  /// Tries that are left; 0: only the password helps.
  [[nodiscard]] int TriesLeft(const std::string& device, const std::string& user, TimePoint now);
  /// Uses up one of them; false if there is none.
  [[nodiscard]] bool UseTry(const std::string& device, const std::string& user, TimePoint now);
  /// The last try was not looked at.
  void GiveBack(const std::string& device, const std::string& user);
  /// The last try was right.
  void Succeeded(const std::string& device, const std::string& user);
  /// In no browser any more.
  void EndAllOf(const std::string& user);
  /// The people for whom it is open in any browser.
  [[nodiscard]] std::vector<std::string> People(TimePoint now);

 private:
  struct Shift {
    TimePoint begun;
    int tries_left = kMaxTries;
  };
  void Expire(TimePoint now);

  std::map<std::pair<std::string, std::string>, Shift> shifts_;  ///< By person and browser.
};

}  // namespace plumb::web
