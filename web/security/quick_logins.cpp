// SPDX-License-Identifier: Apache-2.0
#include "web/security/quick_logins.hpp"

#include <algorithm>

#include "words/web.hpp"

namespace plumb::web {
namespace {

constexpr std::size_t kMaxShifts = 1024;
constexpr std::size_t kMinDigits = 4, kMaxDigits = 8;

bool IsPinDigit(char c) { return c >= '0' && c <= '9'; }
bool IsBadgeLetter(char c) { return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z'); }

/// All digits the same, or each one more or one less than the one before.
bool IsRow(const std::string& digits) {
  for (const int step : {0, 1, -1}) {
    const auto breaks = std::adjacent_find(digits.begin(), digits.end(),
                                           [&](char a, char b) { return b - a != step; });
    if (breaks == digits.end()) return true;
  }
  return false;
}

}  // namespace

Message WhyNotPin(const std::string& pin) {
  if (std::all_of(pin.begin(), pin.end(), IsPinDigit) && pin.size() >= kMinDigits) {
    if (IsRow(pin)) return say::web::PinTooSimple();
    if (pin.size() <= kMaxDigits) return {};
  }
  const bool is_badge =
      pin.size() >= kMaxDigits && pin.size() <= kMaxPin &&
      std::all_of(pin.begin(), pin.end(), [](char c) { return IsPinDigit(c) || IsBadgeLetter(c); });
  return is_badge ? Message() : say::web::PinForm();
}

void QuickLogIns::Expire(TimePoint now) {
  std::erase_if(shifts_, [&](const auto& entry) { return now - entry.second.begun >= kShift; });
}

void QuickLogIns::Open(const std::string& device, const std::string& user, TimePoint now) {
  Expire(now);
  if (shifts_.size() >= kMaxShifts && !shifts_.contains({user, device}))
    shifts_.erase(std::min_element(
        shifts_.begin(), shifts_.end(),
        [](const auto& a, const auto& b) { return a.second.begun < b.second.begun; }));
  shifts_[{user, device}] = {.begun = now};
}

int QuickLogIns::TriesLeft(const std::string& device, const std::string& user, TimePoint now) {
  Expire(now);
  const auto found = shifts_.find({user, device});
  return found == shifts_.end() ? 0 : found->second.tries_left;
}

bool QuickLogIns::UseTry(const std::string& device, const std::string& user, TimePoint now) {
  if (TriesLeft(device, user, now) == 0) return false;
  --shifts_.at({user, device}).tries_left;
  return true;
}

void QuickLogIns::GiveBack(const std::string& device, const std::string& user) {
  if (const auto found = shifts_.find({user, device}); found != shifts_.end())
    found->second.tries_left = std::min(found->second.tries_left + 1, kMaxTries);
}

void QuickLogIns::Succeeded(const std::string& device, const std::string& user) {
  if (const auto found = shifts_.find({user, device}); found != shifts_.end())
    found->second.tries_left = kMaxTries;
}

void QuickLogIns::EndAllOf(const std::string& user) {
  std::erase_if(shifts_, [&](const auto& entry) { return entry.first.first == user; });
}

std::vector<std::string> QuickLogIns::People(TimePoint now) {
  Expire(now);
  std::vector<std::string> people;
  for (const auto& [key, shift] : shifts_)
    if (shift.tries_left > 0 && (people.empty() || people.back() != key.first))
      people.push_back(key.first);
  return people;
}

}  // namespace plumb::web
