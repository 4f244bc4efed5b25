// SPDX-License-Identifier: Apache-2.0
// The hash of a password as an account keeps it.
#pragma once

#include <string>
#include <string_view>

namespace plumb::web {

/// Prefix of the hash of a password chosen by somebody else: the person has to change it at the
/// next login.
inline constexpr std::string_view kChosenByOthers = "first ";

[[nodiscard]] inline bool IsFirst(const std::string& stored) {
  return stored.starts_with(kChosenByOthers);
}
/// In the form that libsodium takes.
[[nodiscard]] inline std::string HashIn(const std::string& stored) {
  return IsFirst(stored) ? stored.substr(kChosenByOthers.size()) : stored;
}

}  // namespace plumb::web
