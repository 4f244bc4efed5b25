// SPDX-License-Identifier: Apache-2.0
// The language for a browser that has chosen none.
#pragma once

#include <span>
#include <string_view>

#include "algo/base/message.hpp"

namespace plumb::web {

/// The best of the known languages for a browser's Accept-Language header; the first, English,
/// where it names none of them.
[[nodiscard]] const Catalogue& PreferredLanguage(
    std::string_view accept_language, std::span<const Catalogue* const> known = Catalogues());

}  // namespace plumb::web
