// The rules for passwords.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace plumb::web {

inline constexpr std::size_t kMinPassword = 10;
inline constexpr std::size_t kMaxPassword = 128;

/// Empty if the person with that name may use the password, otherwise one sentence why not: too
/// short or too long, a common one (in any case, with digits or signs appended), the name, or a
/// short piece repeated.
[[nodiscard]] std::string WhyNotPassword(std::string_view password, std::string_view user);

}  // namespace plumb::web
