// SPDX-License-Identifier: Apache-2.0
#include "web/security/device_cookies.hpp"

#include <array>
#include <stdexcept>

#include <fmt/format.h>
#include <sodium.h>

#include "web/security/secrets.hpp"

namespace plumb::web {
namespace {

constexpr std::size_t kNumberBytes = 16;

std::string Hex(const unsigned char* bytes, std::size_t size) {
  std::string text(2 * size + 1, '\0');
  sodium_bin2hex(text.data(), text.size(), bytes, size);
  text.pop_back();  // its terminating zero
  return text;
}

void Feed(crypto_auth_hmacsha256_state& state, std::string_view text) {
  // Starts with its length, so that different lists of texts never give the same bytes.
  const std::string size = fmt::format("{}:", text.size());
  for (const std::string_view part : {std::string_view(size), text})
    crypto_auth_hmacsha256_update(&state, reinterpret_cast<const unsigned char*>(part.data()),
                                  part.size());
}

}  // namespace

DeviceCookies::DeviceCookies(std::string key, bool tls) : key_(std::move(key)), tls_(tls) {
  if (key_.empty()) key_ = RandomBytes(crypto_auth_hmacsha256_KEYBYTES);
  if (key_.size() != crypto_auth_hmacsha256_KEYBYTES)
    throw std::invalid_argument(fmt::format("a key of device cookies has {} bytes, not {}",
                                            crypto_auth_hmacsha256_KEYBYTES, key_.size()));
}

std::string DeviceCookies::NameFor(std::string_view user) const {
  std::array<unsigned char, crypto_generichash_BYTES_MIN> hash{};
  crypto_generichash(hash.data(), hash.size(), reinterpret_cast<const unsigned char*>(user.data()),
                     user.size(), nullptr, 0);
  return fmt::format("{}plumb_device_{}", tls_ ? "__Host-" : "", Hex(hash.data(), 8));
}

std::string DeviceCookies::CodeOf(std::string_view number, std::string_view user,
                                  std::string_view password_hash) const {
  crypto_auth_hmacsha256_state state;
  crypto_auth_hmacsha256_init(&state, reinterpret_cast<const unsigned char*>(key_.data()),
                              key_.size());
  for (const std::string_view text : {number, user, password_hash}) Feed(state, text);
  std::array<unsigned char, crypto_auth_hmacsha256_BYTES> code{};
  crypto_auth_hmacsha256_final(&state, code.data());
  return Hex(code.data(), code.size());
}

std::string DeviceCookies::Make(std::string_view user, std::string_view password_hash) const {
  const std::string number = RandomToken(kNumberBytes);
  return number + "." + CodeOf(number, user, password_hash);
}

std::optional<std::string> DeviceCookies::Identify(std::string_view value, std::string_view user,
                                                   std::string_view password_hash) const {
  const std::size_t dot = value.find('.');
  if (dot == std::string_view::npos || value.size() > 128 || password_hash.empty())
    return std::nullopt;
  const std::string_view number = value.substr(0, dot), code = value.substr(dot + 1);
  const std::string expected = CodeOf(number, user, password_hash);
  return IsSameSecret(code, expected) ? std::optional(std::string(number)) : std::nullopt;
}

}  // namespace plumb::web
