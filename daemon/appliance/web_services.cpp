#include "daemon/appliance/web_services.hpp"

#include <systemd/sd-id128.h>

#include <array>
#include <cstdlib>
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

}  // namespace

WebServices::WebServices(Appliance& appliance, const UpdateConfig& update,
                         std::unique_ptr<SystemRestart> restart)
    : store_(appliance),
      audit_(MakeWebAuditLog(store_)),
      button_(MakeWebAppliance(appliance)),
      patients_(MakeWebPatients(appliance, store_)),
      references_(MakeWebReferences(appliance, store_)),
      scans_(MakeWebScans(appliance, store_)),
      checks_(MakeWebChecks(appliance, store_)),
      room_(MakeWebRoomCalibration(appliance, store_)),
      profiles_(MakeWebSensorProfiles(appliance, store_)),
      displays_(MakeWebDisplays(store_)),
      accounts_(MakeWebAccounts(store_)),
      settings_(MakeWebSettings(store_)),
      maintenance_(MakeWebMaintenance(appliance, store_)),
      updates_(
          appliance, std::move(restart),
          {.config = update,
           .state = appliance.storage().state(),
           .boot = BootId(),
           .run_in_background =
               [this](std::function<void()> work) {
                 return background_.PostToFiles(std::move(work));
               },
           .changed = [&appliance] { appliance.NotifyWeb(web::EventKind::kUpdate); },
           .log = [this](
                      const Actor& actor, const char* action, const std::string& subject,
                      const std::string& detail) { audit_->Log(actor, action, subject, detail); }}),
      background_(appliance.loop()) {}

}  // namespace plumb
