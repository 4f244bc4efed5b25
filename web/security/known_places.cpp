// SPDX-License-Identifier: Apache-2.0
#include "web/security/known_places.hpp"

#include <algorithm>

namespace plumb::web {

void KnownPlaces::Remember(const std::string& user, const std::string& network, TimePoint now) {
  last_used_[{user, network}] = now;
  if (last_used_.size() <= kMaxPlaces) return;
  last_used_.erase(
      std::min_element(last_used_.begin(), last_used_.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; }));
}

bool KnownPlaces::Knows(const std::string& user, const std::string& network, TimePoint now) const {
  const auto found = last_used_.find({user, network});
  return found != last_used_.end() && now - found->second < kKnownFor;
}

}  // namespace plumb::web
