// SPDX-License-Identifier: Apache-2.0
#include "web/security/patient_hash.hpp"

#include <sodium.h>

#include <array>

#include <fmt/format.h>

#include "web/model/patient.hpp"

namespace plumb::web {

std::string PatientHash(std::string_view code, std::string_view secret) {
  const std::string plain = PlainCode(code);
  std::array<unsigned char, crypto_auth_hmacsha256_BYTES> sum{};
  crypto_auth_hmacsha256_state state;
  crypto_auth_hmacsha256_init(&state, reinterpret_cast<const unsigned char*>(secret.data()),
                              secret.size());
  crypto_auth_hmacsha256_update(&state, reinterpret_cast<const unsigned char*>(plain.data()),
                                plain.size());
  crypto_auth_hmacsha256_final(&state, sum.data());
  return fmt::format("{:02x}", fmt::join(sum, ""));
}

}  // namespace plumb::web
