// SPDX-License-Identifier: Apache-2.0
#include "web/exchange/local_time.hpp"

#include <array>
#include <ctime>

namespace plumb::web {

std::string LocalTimeText(WallClock::time_point time) {
  const std::time_t seconds = WallClock::to_time_t(time);
  std::tm local{};
  ::localtime_r(&seconds, &local);
  std::array<char, 64> text{};
  const std::size_t size = std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M %Z", &local);
  return {text.data(), size};
}

}  // namespace plumb::web
