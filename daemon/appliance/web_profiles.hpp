// The page's service for the sensor's profile.
#pragma once

#include "daemon/appliance/store_access.hpp"
#include "web/service/sensor_profile_service.hpp"

namespace plumb {

/// Its arguments are borrowed.
class WebSensorProfiles : public web::SensorProfileService {
 public:
  WebSensorProfiles(Appliance& appliance, StoreAccess& store)
      : appliance_(appliance), store_(store) {}

  [[nodiscard]] web::SensorProfiles GetSensorProfiles() override;
  [[nodiscard]] std::optional<std::string> SensorProfileFile(int version) override;
  void ResetSensorProfile(const web::Actor& actor, const std::string& serial,
                          web::Done done) override;
  void RollBackSensorProfile(const web::Actor& actor, const std::string& serial, int version,
                             web::Done done) override;

 private:
  /// As StoreAccess::Change(); afterwards the last scan's objection to the profile is discarded.
  void ChangeProfile(const std::string& serial, const web::Done& done,
                     std::function<void(AuditStore&)> change);

  Appliance& appliance_;
  StoreAccess& store_;
};

}  // namespace plumb
