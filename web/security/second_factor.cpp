// SPDX-License-Identifier: Apache-2.0
#include "web/security/second_factor.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <gnutls/crypto.h>
#include <gnutls/gnutls.h>

#include "algo/base/errors.hpp"
#include "web/model/plain_code.hpp"
#include "web/security/secrets.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

constexpr std::string_view kBase32 = "ABCDEFGHIJKLMNOPQRSTUVWXYZ234567";
constexpr std::size_t kSecretBytes = 20;
constexpr int kStep_s = 30;
constexpr std::size_t kCodeDigits = 6;
constexpr int kRecoveryLetters = 16;

std::string ToBase32(std::string_view bytes) {
  std::string text;
  std::uint32_t held = 0;
  int bits = 0;
  for (const char byte : bytes) {
    held = held << 8 | static_cast<unsigned char>(byte);
    for (bits += 8; bits >= 5; bits -= 5) text += kBase32[held >> (bits - 5) & 31];
  }
  if (bits > 0) text += kBase32[held << (5 - bits) & 31];
  return text;
}

std::string FromBase32(std::string_view text) {
  std::string bytes;
  std::uint32_t held = 0;
  int bits = 0;
  for (const char letter : text) {
    const std::size_t value = kBase32.find(letter);
    if (value == std::string_view::npos) throw DataError(say::web::SecondFactorUnreadable());
    held = held << 5 | static_cast<std::uint32_t>(value);
    bits += 5;
    if (bits < 8) continue;
    bits -= 8;
    bytes += static_cast<char>(held >> bits & 0xFF);
  }
  if (bytes.empty()) throw DataError(say::web::SecondFactorUnreadable());
  return bytes;
}

}  // namespace

std::string MakeTotpSecret() { return ToBase32(RandomBytes(kSecretBytes)); }

std::string OtpauthUri(std::string_view user, std::string_view secret) {
  return fmt::format("otpauth://totp/Plumb:{}?secret={}&issuer=Plumb", user, secret);
}

std::int64_t TotpStep(std::chrono::system_clock::time_point time) {
  return std::chrono::system_clock::to_time_t(time) / kStep_s;
}

std::string TotpCode(std::string_view secret, std::int64_t step) {
  const std::string key = FromBase32(secret);
  std::array<unsigned char, 8> counter{};
  for (std::size_t i = 0; i < counter.size(); ++i)
    counter[counter.size() - 1 - i] =
        static_cast<unsigned char>(static_cast<std::uint64_t>(step) >> (8 * i));
  std::array<unsigned char, 20> digest{};
  if (const int result = gnutls_hmac_fast(GNUTLS_MAC_SHA1, key.data(), key.size(), counter.data(),
                                          counter.size(), digest.data());
      result < 0)
    throw IoError(say::web::CannotComputeCode(gnutls_strerror(result)));
  const std::size_t at = digest.back() & 15;
  std::uint32_t number = digest[at] & 0x7F;
  for (std::size_t i = 1; i < 4; ++i) number = number << 8 | digest[at + i];
  return fmt::format("{:06}", number % 1'000'000);
}

std::vector<std::string> MakeRecoveryCodes() {
  std::vector<std::string> codes;
  for (int i = 0; i < kNumRecoveryCodes; ++i) codes.push_back(RandomCode(kRecoveryLetters));
  return codes;
}

std::vector<std::string> HashesOf(const std::vector<std::string>& recovery_codes) {
  std::vector<std::string> hashes;
  for (const std::string& code : recovery_codes) hashes.push_back(StoredHashOf(code));
  return hashes;
}

std::optional<SecondFactor> UsedSecondFactor(const SecondFactor& factor, std::string_view text,
                                             std::chrono::system_clock::time_point now) {
  std::string code = PlainCode(text);
  SecondFactor left = factor;
  if (code.size() == kCodeDigits) {
    const std::int64_t present = TotpStep(now);
    for (std::int64_t step = present - 1; step <= present + 1; ++step) {
      if (step <= factor.last_step || !IsSameSecret(code, TotpCode(factor.secret, step))) continue;
      left.last_step = step;
      return left;
    }
    return std::nullopt;
  }
  // Their hashes are of codes as they are shown.
  code.insert(std::min(code.size(), std::size_t{kRecoveryLetters} / 2), "-");
  const std::string hash = StoredHashOf(code);
  if (std::erase_if(left.recovery_hashes,
                    [&](const std::string& known) { return IsSameSecret(known, hash); }) == 0)
    return std::nullopt;
  return left;
}

}  // namespace plumb::web
