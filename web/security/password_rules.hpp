// Which passwords are taken.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace plumb::web {

inline constexpr std::size_t kMinPassword = 10;
inline constexpr std::size_t kMaxPassword = 128;

/// Empty if the password may be used by the person of that name, else one sentence why not: it is
/// too short or too long, a common one (whatever its case, and with digits or signs behind it), the
/// name, or one short piece again and again.
[[nodiscard]] std::string WhyNotPassword(std::string_view password, std::string_view user);

}  // namespace plumb::web
