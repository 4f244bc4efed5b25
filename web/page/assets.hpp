// SPDX-License-Identifier: Apache-2.0
// The page's files as embedded in the program.
#pragma once

#include <span>
#include <string_view>

namespace plumb::web {

struct Asset {
  std::string_view path;  ///< "/assets/app.1a2b3c4d.js" or "/".
  std::string_view type;
  std::string_view plain;
  std::string_view gzip;  ///< The same, compressed.
  bool hashed = false;    ///< The name changes with the content, so it may be cached for ever.
};

[[nodiscard]] std::span<const Asset> Assets();
/// Null if there is none.
[[nodiscard]] const Asset* FindAsset(std::string_view path);

}  // namespace plumb::web
