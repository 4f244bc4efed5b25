// SPDX-License-Identifier: Apache-2.0
// Whether a person may sign the position that live monitoring shows, instead of a sweep that
// confirms it.
#pragma once

#include <string_view>

#include "algo/base/message.hpp"
#include "web/model/monitoring.hpp"

namespace plumb {

/// @param accept_live  The setting.
/// @param has_reason   For a position out of tolerance.
/// @return Why not; empty: it may be signed.
[[nodiscard]] Message WhyNotAcceptLive(const MonitorStatus& now, std::string_view accept_live,
                                       bool has_reason);

/// The numbers that were signed, for the audit log.
[[nodiscard]] Message DescribeAccepted(const MonitorStatus& now, const std::string& reason);

}  // namespace plumb
