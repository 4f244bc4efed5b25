// The page's service for backups and diagnostics.
#pragma once

#include "daemon/appliance/store_access.hpp"
#include "web/service/maintenance_service.hpp"

namespace plumb {

/// Its arguments are borrowed.
class WebMaintenance : public web::MaintenanceService {
 public:
  WebMaintenance(Appliance& appliance, StoreAccess& store) : appliance_(appliance), store_(store) {}
  ~WebMaintenance() override { *alive_ = false; }
  WebMaintenance(const WebMaintenance&) = delete;
  WebMaintenance& operator=(const WebMaintenance&) = delete;

  void MakeBackup(const web::Actor& actor, web::Done done) override;
  void WriteDiagnostics(const web::Actor& actor, web::Done done) override;

 private:
  Appliance& appliance_;
  StoreAccess& store_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
};

}  // namespace plumb
