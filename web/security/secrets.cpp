// SPDX-License-Identifier: Apache-2.0
#include "web/security/secrets.hpp"

#include <sodium.h>

#include <cstdint>

#include "algo/base/base64.hpp"
#include "algo/base/errors.hpp"
#include "words/web.hpp"

namespace plumb::web {

std::string RandomBytes(std::size_t bytes) {
  if (sodium_init() < 0) throw IoError(say::web::NoRandom());
  std::string random(bytes, '\0');
  randombytes_buf(random.data(), random.size());
  return random;
}

std::string RandomCode(int letters) {
  constexpr std::string_view kLetters = "23456789ABCDEFGHJKLMNPQRSTUVWXYZ";
  std::string code;
  for (int i = 0; i < letters; ++i) {
    if (i == letters / 2) code += '-';
    code += kLetters[randombytes_uniform(static_cast<std::uint32_t>(kLetters.size()))];
  }
  return code;
}

std::string RandomToken(std::size_t bytes) { return ToBase64Url(RandomBytes(bytes)); }

std::string StoredHashOf(const std::string& token) {
  const std::string hash = HashOf(token);
  std::string text(2 * hash.size() + 1, '\0');
  sodium_bin2hex(text.data(), text.size(), reinterpret_cast<const unsigned char*>(hash.data()),
                 hash.size());
  text.pop_back();  // its terminating zero
  return text;
}

std::string HashOf(const std::string& secret) {
  std::string hash(crypto_generichash_BYTES, '\0');
  crypto_generichash(reinterpret_cast<unsigned char*>(hash.data()), hash.size(),
                     reinterpret_cast<const unsigned char*>(secret.data()), secret.size(), nullptr,
                     0);
  return hash;
}

bool IsSameSecret(std::string_view a, std::string_view b) {
  return a.size() == b.size() && sodium_memcmp(a.data(), b.data(), a.size()) == 0;
}

}  // namespace plumb::web
