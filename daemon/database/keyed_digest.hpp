// SPDX-License-Identifier: Apache-2.0
// A function of SQL.
#pragma once

#include <cstddef>
#include <string>

struct sqlite3;

namespace plumb {

inline constexpr std::size_t kRowKeyBytes = 32;

/// Gives a connection `keyed_digest(...)`: HMAC-SHA256 over the types and values of its arguments,
/// in hexadecimal digits. A schema from elsewhere cannot call it. Replaces an earlier key.
/// @returns SQLite's code
int AddKeyedDigest(sqlite3* handle, const std::string& key);

}  // namespace plumb
