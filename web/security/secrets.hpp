// SPDX-License-Identifier: Apache-2.0
// Secrets: made at random, kept as hashes, compared in constant time.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace plumb::web {

/// Random text from that many bytes of the system's generator, in letters, digits, '-' and '_'.
[[nodiscard]] std::string RandomToken(std::size_t bytes);

/// A code that people type: that many letters and digits that are not easily confused, of 5 bits
/// each, with a hyphen in the middle, as in "AB3D-7KQM".
[[nodiscard]] std::string RandomCode(int letters);

/// The hash by which a display's token is stored, in hexadecimal digits.
[[nodiscard]] std::string StoredHashOf(const std::string& token);

/// That many bytes from the same generator.
[[nodiscard]] std::string RandomBytes(std::size_t bytes);

/// The hash of a secret, as bytes.
[[nodiscard]] std::string HashOf(const std::string& secret);

/// Takes as long for a wrong text as for the right one of the same length.
[[nodiscard]] bool IsSameSecret(std::string_view a, std::string_view b);

}  // namespace plumb::web
