// The diagnostics for the manufacturer: the state of the appliance, without data of patients or
// users.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "web/service/service_types.hpp"

namespace plumb {

/// Version, health, state, sensor, counts of frames, the event loop and the audit log's actions. No
/// scan, verdict or number of a patient, and no account: everything that is not named here is left
/// out.
/// @param status  Appliance::StatusJson().
/// @param loop  LoopTable().
[[nodiscard]] std::string DiagnosticsText(const nlohmann::json& status, const web::Health& health,
                                          const std::string& loop,
                                          const std::vector<web::AuditEntry>& audit);

}  // namespace plumb
