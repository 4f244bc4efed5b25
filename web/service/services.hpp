// What the web asks of the appliance, one interface for each subject. The daemon implements them;
// the web only calls.
#pragma once

#include "web/service/account_service.hpp"
#include "web/service/appliance_service.hpp"
#include "web/service/audit_log.hpp"
#include "web/service/background_work.hpp"
#include "web/service/check_service.hpp"
#include "web/service/display_service.hpp"
#include "web/service/maintenance_service.hpp"
#include "web/service/patient_service.hpp"
#include "web/service/reference_service.hpp"
#include "web/service/room_calibration_service.hpp"
#include "web/service/scan_service.hpp"
#include "web/service/sensor_profile_service.hpp"
#include "web/service/settings_service.hpp"
#include "web/service/update_service.hpp"

namespace plumb::web {

/// The appliance as the page sees it. Borrowed: the services live longer than what uses them. Each
/// handler takes the services that it needs, never all of them.
///
/// Every function is called on the loop thread and returns within a few milliseconds: reads answer
/// from memory or from an index, changes may finish later. Those marked (aside) read lists: they
/// are called within BackgroundWork::Later(), as the others beside them may be. Each change and its
/// audit entry are one transaction of the store. Nothing throws but std::bad_alloc: what goes wrong
/// is a Change. Strings that come in are valid UTF-8, short, and without control characters, but
/// their meaning is not checked.
struct Services {
  BackgroundWork& background;
  ApplianceService& appliance;
  PatientService& patients;
  ReferenceService& references;
  ScanService& scans;
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
