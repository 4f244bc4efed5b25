// SPDX-License-Identifier: Apache-2.0
// Text from outside: paths, names of devices, messages of libraries.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace plumb {

/// Bytes of the UTF-8 sequence that `text`, which is not empty, begins with; 0 where it is
/// malformed (overlong, surrogate, beyond U+10FFFF, truncated).
[[nodiscard]] std::size_t Utf8Length(std::string_view text, std::uint32_t& code);

/// The same text, with U+FFFD for each byte that is not UTF-8.
[[nodiscard]] std::string ValidUtf8(std::string_view text);

/// Number of characters (code points) of valid UTF-8.
[[nodiscard]] std::size_t Utf8Characters(std::string_view text);

}  // namespace plumb
