// SPDX-License-Identifier: Apache-2.0
// Audit log entries for viewing and downloading patient data.
#pragma once

#include <chrono>
#include <functional>

#include "web/http/router.hpp"
#include "web/service/account_services.hpp"

namespace plumb::web {

/// Repeated views of one thing by one person from one address are logged once in this time
/// ("view.scan"), because a page requests the same thing again and again.
inline constexpr std::chrono::minutes kSameView{60};

/// Logs the answers of the routes of `router` that disclose patient data, for the routes that exist
/// at the time of the call.
/// Each download has an entry of its own ("download.report"). Refusals are not logged, nor are
/// paired displays, which show the actions of others.
/// @param log  Outlives the router.
/// @param now  A monotonic clock.
void LogDisclosures(Router& router, AuditLog& log,
                    std::function<std::chrono::steady_clock::time_point()> now);

}  // namespace plumb::web
