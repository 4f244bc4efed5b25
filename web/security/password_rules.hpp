// SPDX-License-Identifier: Apache-2.0
// The rules for passwords.
#pragma once

#include <cstddef>
#include <string_view>

#include "algo/base/message.hpp"

namespace plumb::web {

inline constexpr std::size_t kMinPassword = 10;
inline constexpr std::size_t kMaxPassword = 128;

/// Empty if the person with that name may use the password, otherwise why not: too
/// short or too long, a common one (in any case, with digits or signs appended), the name, or a
/// short piece repeated.
[[nodiscard]] Message WhyNotPassword(std::string_view password, std::string_view user);

}  // namespace plumb::web
