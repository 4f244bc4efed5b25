// SPDX-License-Identifier: Apache-2.0
// The diagnostics for the manufacturer: the state of the appliance, without data of patients or
// users.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "web/model/audit.hpp"
#include "web/model/status.hpp"

namespace plumb {

/// Version, health, state, sensor, counts of frames, the event loop and the audit log's actions. No
/// scan, verdict or number of a patient, and no account: everything that is not named here is left
/// out.
/// @param status  Appliance::StatusJson().
/// @param loop  LoopTable().
[[nodiscard]] std::string DiagnosticsText(const nlohmann::json& status, const Health& health,
                                          const std::string& loop,
                                          const std::vector<AuditEntry>& audit);

}  // namespace plumb
