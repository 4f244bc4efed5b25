// SPDX-License-Identifier: Apache-2.0
#include "web/page/assets.hpp"

#include <algorithm>

namespace plumb::web {

const Asset* FindAsset(std::string_view path) {
  const std::span<const Asset> assets = Assets();
  const auto found = std::find_if(assets.begin(), assets.end(),
                                  [&](const Asset& asset) { return asset.path == path; });
  return found == assets.end() ? nullptr : &*found;
}

}  // namespace plumb::web
