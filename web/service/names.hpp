// Names of purposes, outcomes and roles in the interface, in the store and in the log.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "web/service/service_types.hpp"

namespace plumb::web {

/// In the order of the enumerators.
inline constexpr std::array<std::string_view, 3> kPurposeNames = {"fraction", "reference",
                                                                  "daily_check"};
inline constexpr std::array<std::string_view, 4> kOutcomeNames = {"running", "done", "cancelled",
                                                                  "failed"};
inline constexpr std::array<std::string_view, 4> kRoleNames = {"technician", "physicist",
                                                               "engineer", "display"};
static_assert(kPurposeNames.size() == static_cast<std::size_t>(ScanPurpose::kDailyCheck) + 1);
static_assert(kOutcomeNames.size() == static_cast<std::size_t>(ScanOutcome::kFailed) + 1);
static_assert(kRoleNames.size() == static_cast<std::size_t>(Role::kDisplay) + 1);

}  // namespace plumb::web
