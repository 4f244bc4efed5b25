// SPDX-License-Identifier: Apache-2.0
// Permissions of the roles.
#pragma once

#include <string_view>
#include <vector>

#include "web/model/account.hpp"

namespace plumb::web {

enum class Permission {
  kNone,  ///< No login is required.
  kLogin,
  kRoom,  ///< Content of the display in the room.
  kView,
  kScan,
  kPatients,
  kPlan,
  kApprove,
  kCalibrate,  ///< Calibration of the room.
  kAccept,
  kWipe,
  kUsers,
  kAudit,
  kSettings,
  kUpdate,
  kDiagnostics,
};

[[nodiscard]] bool May(Role role, Permission permission);
[[nodiscard]] std::vector<Permission> PermissionsOf(Role role);
[[nodiscard]] std::string_view Name(Permission permission);

}  // namespace plumb::web
