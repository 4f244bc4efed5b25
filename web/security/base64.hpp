// SPDX-License-Identifier: Apache-2.0
// Bytes as text (RFC 4648), in a time that does not depend on them.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace plumb::web {

[[nodiscard]] std::string ToBase64(std::string_view bytes);

/// With '-' and '_' and without padding, as it may stand in a cookie.
[[nodiscard]] std::string ToBase64Url(std::string_view bytes);

/// The reverse of ToBase64(). Nothing if it is not the whole text of that kind.
[[nodiscard]] std::optional<std::string> FromBase64(std::string_view text);

}  // namespace plumb::web
