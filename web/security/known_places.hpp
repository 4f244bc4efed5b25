// SPDX-License-Identifier: Apache-2.0
// From which addresses a person has logged in before.
#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <string>
#include <utility>

namespace plumb::web {

/// Workstations that forget their cookies, as many hospitals set them up to do: their address takes
/// the place of the device cookie, so that guesses from elsewhere do not lock them out. Kept in
/// memory only, and bounded: what was used longest ago is forgotten first.
class KnownPlaces {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  static constexpr std::chrono::hours kKnownFor{30 * 24};
  static constexpr std::size_t kMaxPlaces = 1024;

  /// @param network  As NetworkOf() returns it.
  void Remember(const std::string& user, const std::string& network, TimePoint now);
  [[nodiscard]] bool Knows(const std::string& user, const std::string& network,
                           TimePoint now) const;

 private:
  std::map<std::pair<std::string, std::string>, TimePoint> last_used_;  ///< By person and network.
};

}  // namespace plumb::web
