// SPDX-License-Identifier: Apache-2.0
#include "web/security/permissions.hpp"

#include <array>

namespace plumb::web {
namespace {

struct Row {
  Permission permission;
  std::string_view name;
  bool technician, physicist, engineer, display;
};

constexpr std::array kTable = {
    Row{Permission::kNone, "none", true, true, true, true},
    Row{Permission::kLogin, "login", true, true, true, true},
    Row{Permission::kRoom, "room", true, true, true, true},
    Row{Permission::kView, "view", true, true, true, false},
    Row{Permission::kScan, "scan", true, true, true, false},
    Row{Permission::kPatients, "patients", true, true, false, false},
    Row{Permission::kPlan, "plan", false, true, false, false},
    Row{Permission::kApprove, "approve", false, true, false, false},
    Row{Permission::kCalibrate, "calibrate", false, true, true, false},
    Row{Permission::kAccept, "accept", true, true, false, false},
    Row{Permission::kWipe, "wipe", false, true, false, false},
    Row{Permission::kUsers, "users", false, false, true, false},
    Row{Permission::kAudit, "audit", false, true, true, false},
    Row{Permission::kSettings, "settings", false, false, true, false},
    Row{Permission::kUpdate, "update", false, false, true, false},
    Row{Permission::kDiagnostics, "diagnostics", false, false, true, false},
};
static_assert(kTable.size() == static_cast<std::size_t>(Permission::kDiagnostics) + 1);

}  // namespace

bool May(Role role, Permission permission) {
  for (const Row& row : kTable) {
    if (row.permission != permission) continue;
    switch (role) {
      case Role::kTechnician:
        return row.technician;
      case Role::kPhysicist:
        return row.physicist;
      case Role::kEngineer:
        return row.engineer;
      case Role::kDisplay:
        return row.display;
    }
  }
  return false;
}

std::vector<Permission> PermissionsOf(Role role) {
  std::vector<Permission> permissions;
  for (const Row& row : kTable) {
    if (May(role, row.permission)) permissions.push_back(row.permission);
  }
  return permissions;
}

std::string_view Name(Permission permission) {
  for (const Row& row : kTable) {
    if (row.permission == permission) return row.name;
  }
  return {};
}

}  // namespace plumb::web
