// SPDX-License-Identifier: Apache-2.0
#include "daemon/services/web_services.hpp"

#include <systemd/sd-id128.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <fstream>
#include <string>
#include <utility>

namespace plumb {

namespace {

/// Identifier of this start of the machine. The unit passes it on, because its sandbox hides the
/// file.
std::string BootId() {
  if (const char* given = std::getenv("PLUMB_BOOT_ID"); given != nullptr) return given;
  sd_id128_t id{};
  std::array<char, SD_ID128_STRING_MAX> text{};
  return sd_id128_get_boot(&id) < 0 ? std::string() : sd_id128_to_string(id, text.data());
}

/// Of this unit, as it was provisioned; its host name otherwise.
std::string UnitSerial() {
  std::string serial;
  std::ifstream file("/data/unit/serial");
  if (std::getline(file, serial) && !serial.empty() && serial.size() <= 64) return serial;
  std::array<char, 256> name{};
  (void)::gethostname(name.data(), name.size() - 1);
  return name.data();
}

}  // namespace

WebServices::WebServices(Appliance& appliance, SharedParts& shared,
                         std::unique_ptr<SystemRestart> restart)
    : store_(shared.loop, shared.storage, shared.store_thread, shared.notices),
      audit_(MakeWebAuditLog(store_)),
      button_(MakeWebAppliance(appliance, shared.sensors, shared.outline, shared.notices)),
      patients_(
          MakeWebPatients(appliance, shared.session, shared.references, shared.notices, store_)),
      references_(MakeWebReferences(shared.references, shared.session, shared.room, store_,
                                    background_, stop_.get_token())),
      planning_(MakeWebPlanning(shared.loop, shared.given.config_file, *references_, store_)),
      scans_(MakeWebScans(appliance, shared.references, shared.room, store_,
                          [this] { archive_.Wake(); })),
      monitoring_(MakeWebMonitoring(shared.monitoring, store_)),
      checks_(MakeWebChecks(appliance, shared.references, store_)),
      room_(MakeWebRoomCalibration(shared.room, store_)),
      profiles_(MakeWebSensorProfiles(appliance, shared, background_, store_)),
      displays_(MakeWebDisplays(store_)),
      accounts_(MakeWebAccounts(store_)),
      settings_(MakeWebSettings(shared.notices, store_)),
      maintenance_(MakeWebMaintenance(appliance, shared.upkeep, shared.messages,
                                      shared.loop.meter(), store_)),
      updates_(
          shared.loop, appliance, shared.session, std::move(restart),
          {.config = shared.given.config.update,
           .state = shared.storage.state(),
           .serial = UnitSerial(),
           .boot = BootId(),
           .run_in_background =
               [this](std::function<void()> work) {
                 return background_.PostToFiles(std::move(work));
               },
           .stop = stop_.get_token(),
           .changed = [&notices = shared.notices] { notices.TellPage(web::EventKind::kUpdate); },
           .log = [this](const Actor& actor, const char* action, const std::string& subject,
                         const Message& detail) { audit_->Log(actor, action, subject, detail); }}),
      background_(shared.loop),
      archive_(
          shared.loop, shared.given.config_file, shared.given.config.messages.language, store_,
          [this](const std::string& scan, const Catalogue& language) {
            return scans_->ScanReport(scan, language);
          },
          [&shared](const Message& failure) {
            if (std::exchange(shared.not_archived, failure) != failure)
              shared.notices.TellPage(web::EventKind::kStatus);
          }) {}

}  // namespace plumb
