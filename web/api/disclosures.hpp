// Who saw data of patients, and who took some away: entries of the audit log.
#pragma once

#include <chrono>
#include <functional>
#include <string_view>

#include "web/http/router.hpp"
#include "web/service/audit_log.hpp"

namespace plumb::web {

/// What one person sees of one thing from one address is one entry in this time ("view.scan"): a
/// page asks for the same thing again and again.
inline constexpr std::chrono::minutes kSameView{60};

/// True for the routes that answer with data of patients, the camera's picture among them. The
/// status and its events are none: they name the open session only.
[[nodiscard]] bool DisclosesPatientData(std::string_view pattern);

/// Has what these routes of `router` answer logged, for those that are there now. Each download is
/// an entry of its own ("download.report"). Refusals are not logged, nor a paired display: it shows
/// what others do.
/// @param log  Outlives the router.
/// @param now  A clock that does not step.
void LogDisclosures(Router& router, AuditLog& log,
                    std::function<std::chrono::steady_clock::time_point()> now);

}  // namespace plumb::web
