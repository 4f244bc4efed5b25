// SPDX-License-Identifier: Apache-2.0
// The interface of the appliance to the web, one class for each subject. The daemon implements it;
// the web only calls it.
#pragma once

#include "web/service/account_services.hpp"
#include "web/service/appliance_service.hpp"
#include "web/service/background_work.hpp"
#include "web/service/monitoring_service.hpp"
#include "web/service/patient_services.hpp"
#include "web/service/planning_service.hpp"
#include "web/service/room_services.hpp"
#include "web/service/scan_service.hpp"
#include "web/service/upkeep_services.hpp"

namespace plumb::web {

/// The services of the appliance. Borrowed: they outlive their users. Each handler takes the
/// services that it needs, never all of them.
///
/// Every function is called on the loop thread and returns within a few milliseconds: reads answer
/// from memory or from an index, changes may finish later. Functions marked (background) read
/// lists: they must be called within BackgroundWork::RunInBackground(), and the others beside them
/// may be. Each change and its audit entry are one transaction of the store. Nothing throws except
/// std::bad_alloc; errors are reported as a Change. Arguments are valid UTF-8, short, and without
/// control characters, but their meaning is not checked.
struct Services {
  BackgroundWork& background;
  ApplianceService& appliance;
  PatientService& patients;
  ReferenceService& references;
  PlanningService& planning;
  ScanService& scans;
  MonitoringService& monitoring;
  CheckService& checks;
  RoomCalibrationService& room;
  SensorProfileService& profiles;
  DisplayService& displays;
  AccountService& accounts;
  AuditLog& audit;
  SettingsService& settings;
  UpdateService& updates;
  MaintenanceService& maintenance;
};

}  // namespace plumb::web
