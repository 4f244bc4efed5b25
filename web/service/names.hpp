// Names of values in the interface, in the store, on the control socket and in the log.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

#include "web/service/service_types.hpp"

namespace plumb::web {

/// One name for each value up to kLast; any other number of names does not compile.
template <auto kLast, std::size_t kSize>
consteval std::array<std::string_view, kSize> NamesUpTo(const std::string_view (&names)[kSize]) {
  static_assert(kSize == static_cast<std::size_t>(kLast) + 1);
  return std::to_array(names);
}

/// In the order of the enumerators; empty for other types.
template <typename Enum>
inline constexpr std::array<std::string_view, 0> kNamesOf{};
template <>
inline constexpr auto kNamesOf<ApplianceState> = NamesUpTo<ApplianceState::kFault>(
    {"no_sensor", "ready", "scanning", "working", "result", "fault"});
template <>
inline constexpr auto kNamesOf<FaultKind> = NamesUpTo<FaultKind::kStorage>({"none", "sensor",
                                                                            "scan", "storage"});
template <>
inline constexpr auto kNamesOf<SweepAdvice> = NamesUpTo<SweepAdvice::kComputerTooSlow>(
    {"none", "slower", "closer", "farther", "tracking_lost", "no_markers", "computer_too_slow"});
template <>
inline constexpr auto kNamesOf<ScanPurpose> =
    NamesUpTo<ScanPurpose::kDailyCheck>({"fraction", "reference", "daily_check"});
template <>
inline constexpr auto kNamesOf<ScanOutcome> =
    NamesUpTo<ScanOutcome::kFailed>({"running", "done", "cancelled", "failed"});
template <>
inline constexpr auto kNamesOf<Role> = NamesUpTo<Role::kDisplay>({"technician", "physicist",
                                                                  "engineer", "display"});

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

}  // namespace plumb::web
