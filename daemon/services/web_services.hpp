// SPDX-License-Identifier: Apache-2.0
// The services of the page, implemented by the appliance.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>

#include "daemon/appliance/appliance.hpp"
#include "daemon/appliance/shared_parts.hpp"
#include "daemon/services/background_threads.hpp"
#include "daemon/services/result_archive.hpp"
#include "daemon/services/store_access.hpp"
#include "daemon/services/updates.hpp"
#include "web/service/services.hpp"

namespace plumb {

// Make the services, which are implemented in web_*.cpp. They keep references to the arguments.
[[nodiscard]] std::unique_ptr<web::AccountService> MakeWebAccounts(StoreAccess& store);
[[nodiscard]] std::unique_ptr<web::ApplianceService> MakeWebAppliance(Appliance& appliance,
                                                                      const SensorThread& sensors,
                                                                      OutlineWatch& outline,
                                                                      Notices& notices);
[[nodiscard]] std::unique_ptr<web::AuditLog> MakeWebAuditLog(StoreAccess& store);
[[nodiscard]] std::unique_ptr<web::CheckService> MakeWebChecks(Appliance& appliance,
                                                               const ReferenceGate& references,
                                                               StoreAccess& store);
[[nodiscard]] std::unique_ptr<web::DisplayService> MakeWebDisplays(StoreAccess& store);
[[nodiscard]] std::unique_ptr<web::MaintenanceService> MakeWebMaintenance(Appliance& appliance,
                                                                          StorageUpkeep& upkeep,
                                                                          MessagesOut& messages,
                                                                          const LoopMeter& meter,
                                                                          StoreAccess& store);
[[nodiscard]] std::unique_ptr<web::MonitoringService> MakeWebMonitoring(LiveMonitoring& monitoring,
                                                                        StoreAccess& store);
[[nodiscard]] std::unique_ptr<web::PatientService> MakeWebPatients(Appliance& appliance,
                                                                   CurrentSession& session,
                                                                   const ReferenceGate& references,
                                                                   Notices& notices,
                                                                   StoreAccess& store);
[[nodiscard]] std::unique_ptr<web::PlanningService> MakeWebPlanning(
    EventLoop& loop, std::optional<std::filesystem::path> config_file,
    web::ReferenceService& references, StoreAccess& store);
[[nodiscard]] std::unique_ptr<web::ReferenceService> MakeWebReferences(
    const ReferenceGate& references, const CurrentSession& session, const RoomInUse& room,
    StoreAccess& store, web::BackgroundWork& background, std::stop_token stop);
[[nodiscard]] std::unique_ptr<web::RoomCalibrationService> MakeWebRoomCalibration(
    RoomInUse& room, StoreAccess& store);
[[nodiscard]] std::unique_ptr<web::ScanService> MakeWebScans(Appliance& appliance,
                                                             const ReferenceGate& references,
                                                             const RoomInUse& room,
                                                             StoreAccess& store,
                                                             std::function<void()> accepted);
[[nodiscard]] std::unique_ptr<web::SensorProfileService> MakeWebSensorProfiles(
    Appliance& appliance, SharedParts& shared, web::BackgroundWork& background, StoreAccess& store);
[[nodiscard]] std::unique_ptr<web::SettingsService> MakeWebSettings(Notices& notices,
                                                                    StoreAccess& store);

/// Owns the services, one class for each subject. Used on the loop's thread.
class WebServices {
 public:
  /// Appliance and parts are borrowed and outlive this object. @param restart  Restarts the
  /// machine.
  WebServices(Appliance& appliance, SharedParts& shared, std::unique_ptr<SystemRestart> restart);
  ~WebServices() { stop_.request_stop(); }  // or a long import would be waited for
  WebServices(const WebServices&) = delete;
  WebServices& operator=(const WebServices&) = delete;

  /// References to what this object owns.
  [[nodiscard]] web::Services services() {
    return {.background = background_,
            .appliance = *button_,
            .patients = *patients_,
            .references = *references_,
            .planning = *planning_,
            .scans = *scans_,
            .monitoring = *monitoring_,
            .checks = *checks_,
            .room = *room_,
            .profiles = *profiles_,
            .displays = *displays_,
            .accounts = *accounts_,
            .audit = *audit_,
            .settings = *settings_,
            .updates = updates_,
            .maintenance = *maintenance_};
  }
  [[nodiscard]] Updates& updates() { return updates_; }

 private:
  std::stop_source stop_;
  StoreAccess store_;
  std::unique_ptr<web::AuditLog> audit_;
  std::unique_ptr<web::ApplianceService> button_;
  std::unique_ptr<web::PatientService> patients_;
  std::unique_ptr<web::ReferenceService> references_;
  std::unique_ptr<web::PlanningService> planning_;
  std::unique_ptr<web::ScanService> scans_;
  std::unique_ptr<web::MonitoringService> monitoring_;
  std::unique_ptr<web::CheckService> checks_;
  std::unique_ptr<web::RoomCalibrationService> room_;
  std::unique_ptr<web::SensorProfileService> profiles_;
  std::unique_ptr<web::DisplayService> displays_;
  std::unique_ptr<web::AccountService> accounts_;
  std::unique_ptr<web::SettingsService> settings_;
  std::unique_ptr<web::MaintenanceService> maintenance_;
  // Declared last, so destroyed first: their callbacks and their work use the members above.
  Updates updates_;
  BackgroundThreads background_;
  ResultArchive archive_;
};

}  // namespace plumb
