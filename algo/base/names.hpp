// SPDX-License-Identifier: Apache-2.0
// Enumerators and their names in files, in the interface, on the control socket and in the log.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

namespace plumb {

/// One name for each value up to kLast; any other number of names does not compile.
template <auto kLast, std::size_t kSize>
consteval std::array<std::string_view, kSize> NamesUpTo(const std::string_view (&names)[kSize]) {
  static_assert(kSize == static_cast<std::size_t>(kLast) + 1);
  return std::to_array(names);
}

/// In the order of the enumerators; empty for types without names. Specialised beside each type.
template <typename Enum>
inline constexpr std::array<std::string_view, 0> kNamesOf{};

template <typename Enum>
requires(!kNamesOf<Enum>.empty()) [[nodiscard]] constexpr std::string_view Name(Enum value) {
  return kNamesOf<Enum>.at(static_cast<std::size_t>(value));
}

/// The value with that name; nothing if there is none.
template <typename Enum>
[[nodiscard]] constexpr std::optional<Enum> Named(std::string_view name) {
  const auto found = std::ranges::find(kNamesOf<Enum>, name);
  if (found == kNamesOf<Enum>.end()) return std::nullopt;
  return static_cast<Enum>(found - kNamesOf<Enum>.begin());
}

}  // namespace plumb
