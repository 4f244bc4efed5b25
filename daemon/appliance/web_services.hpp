// The services of the page, implemented by the appliance.
#pragma once

#include <memory>

#include "daemon/appliance/background_threads.hpp"
#include "daemon/appliance/store_access.hpp"
#include "daemon/appliance/updates.hpp"
#include "daemon/appliance/web_accounts.hpp"
#include "daemon/appliance/web_appliance.hpp"
#include "daemon/appliance/web_checks.hpp"
#include "daemon/appliance/web_maintenance.hpp"
#include "daemon/appliance/web_patients.hpp"
#include "daemon/appliance/web_profiles.hpp"
#include "daemon/appliance/web_references.hpp"
#include "daemon/appliance/web_room.hpp"
#include "daemon/appliance/web_scans.hpp"
#include "daemon/appliance/web_settings.hpp"
#include "web/service/services.hpp"

namespace plumb {

/// Owns the services, one class for each subject. Used on the loop's thread.
class WebServices {
 public:
  /// The appliance is borrowed and outlives this object. @param restart  Restarts the machine.
  WebServices(Appliance& appliance, const UpdateConfig& update,
              std::unique_ptr<SystemRestart> restart);

  /// References to members of this object.
  [[nodiscard]] web::Services services() {
    return {.background = background_,
            .appliance = button_,
            .patients = patients_,
            .references = references_,
            .scans = scans_,
            .checks = checks_,
            .room = room_,
            .profiles = profiles_,
            .displays = displays_,
            .accounts = accounts_,
            .audit = audit_,
            .settings = settings_,
            .updates = updates_,
            .maintenance = maintenance_};
  }
  [[nodiscard]] Updates& updates() { return updates_; }

 private:
  StoreAccess store_;
  WebAuditLog audit_;
  WebAppliance button_;
  WebPatients patients_;
  WebReferences references_;
  WebScans scans_;
  WebChecks checks_;
  WebRoomCalibration room_;
  WebSensorProfiles profiles_;
  WebDisplays displays_;
  WebAccounts accounts_;
  WebSettings settings_;
  WebMaintenance maintenance_;
  // Declared last, so destroyed first: their callbacks and their work use the members above.
  Updates updates_;
  BackgroundThreads background_;
};

}  // namespace plumb
