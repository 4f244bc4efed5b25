// SPDX-License-Identifier: Apache-2.0
// The second factor of a log-in: codes of an authenticator by time (TOTP, RFC 6238), and recovery
// codes for when it is lost.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "web/model/account.hpp"

namespace plumb::web {

inline constexpr int kNumRecoveryCodes = 10;

/// A new secret of 160 bits in base32, as authenticators take it.
/// @throws IoError without a random generator.
[[nodiscard]] std::string MakeTotpSecret();

/// "otpauth://totp/Plumb:NAME?secret=...", as authenticators read it.
[[nodiscard]] std::string OtpauthUri(std::string_view user, std::string_view secret);

/// Steps of 30 seconds since 1970.
[[nodiscard]] std::int64_t TotpStep(std::chrono::system_clock::time_point time);

/// The code of six digits of a step: HMAC-SHA1 of GnuTLS, cut as RFC 4226 says.
/// @param secret  Base32.
/// @throws DataError for a secret that is not base32; IoError if the library refuses.
[[nodiscard]] std::string TotpCode(std::string_view secret, std::int64_t step);

/// Ten codes of 80 bits each, for people to keep; only their hashes are stored.
[[nodiscard]] std::vector<std::string> MakeRecoveryCodes();
[[nodiscard]] std::vector<std::string> HashesOf(const std::vector<std::string>& recovery_codes);

/// The second factor after `text` was used, or nothing if the text is wrong. It may be a code of
/// the present step, the previous or the next one (each once, and in order), or a recovery code,
/// which is then removed.
/// @throws as TotpCode()
[[nodiscard]] std::optional<SecondFactor> UsedSecondFactor(
    const SecondFactor& factor, std::string_view text, std::chrono::system_clock::time_point now);

}  // namespace plumb::web
