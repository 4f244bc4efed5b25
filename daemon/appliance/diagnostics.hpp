// What the maker is sent: how the appliance does, and nothing of the people it serves.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "web/service/service_types.hpp"

namespace plumb {

/// Version, health, state, sensor, counts of frames, the event loop and the audit log's actions. No
/// scan, verdict or number of a patient, no account: what is not named here stays out.
/// @param status  Appliance::StatusJson().
/// @param loop  LoopTable().
[[nodiscard]] std::string DiagnosticsText(const nlohmann::json& status, const web::Health& health,
                                          const std::string& loop,
                                          const std::vector<web::AuditEntry>& audit);

}  // namespace plumb
