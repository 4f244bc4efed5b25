// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/keyed_digest.hpp"

#include <sodium.h>
#include <sqlite3.h>

#include <array>

#include <fmt/format.h>

namespace plumb {
namespace {

constexpr int kAnyNumber = -1;

/// The length before each value keeps ("ab", "c") and ("a", "bc") apart. The text of a number is
/// SQLite's own.
void AddValue(crypto_auth_hmacsha256_state& state, sqlite3_value* value) {
  const int type = sqlite3_value_type(value);
  const unsigned char* const text = sqlite3_value_text(value);
  const int length = text == nullptr ? 0 : sqlite3_value_bytes(value);
  const std::string head = fmt::format("{}:{}:", type, length);
  crypto_auth_hmacsha256_update(&state, reinterpret_cast<const unsigned char*>(head.data()),
                                head.size());
  if (length > 0) crypto_auth_hmacsha256_update(&state, text, static_cast<std::size_t>(length));
}

void KeyedDigest(sqlite3_context* context, int num_values, sqlite3_value** values) {
  const auto& key = *static_cast<const std::string*>(sqlite3_user_data(context));
  crypto_auth_hmacsha256_state state;
  crypto_auth_hmacsha256_init(&state, reinterpret_cast<const unsigned char*>(key.data()),
                              key.size());
  for (int i = 0; i < num_values; ++i) AddValue(state, values[i]);
  std::array<unsigned char, crypto_auth_hmacsha256_BYTES> code{};
  crypto_auth_hmacsha256_final(&state, code.data());
  std::array<char, 2 * crypto_auth_hmacsha256_BYTES + 1> hex{};
  sqlite3_result_text(context, sodium_bin2hex(hex.data(), hex.size(), code.data(), code.size()), -1,
                      SQLITE_TRANSIENT);
}

}  // namespace

int AddKeyedDigest(sqlite3* handle, const std::string& key) {
  return sqlite3_create_function_v2(
      handle, "keyed_digest", kAnyNumber, SQLITE_UTF8 | SQLITE_DETERMINISTIC, new std::string(key),
      KeyedDigest, nullptr, nullptr, [](void* kept) { delete static_cast<std::string*>(kept); });
}

}  // namespace plumb
