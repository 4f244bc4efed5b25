// The page's service for references.
#pragma once

#include "daemon/appliance/store_access.hpp"
#include "web/service/reference_service.hpp"

namespace plumb {

/// Its arguments are borrowed.
class WebReferences : public web::ReferenceService {
 public:
  WebReferences(Appliance& appliance, StoreAccess& store) : appliance_(appliance), store_(store) {}

  [[nodiscard]] std::vector<web::Reference> References(const std::string& patient_id) override;
  [[nodiscard]] std::optional<web::Reference> FindReference(const std::string& id) override;
  [[nodiscard]] web::RoomOnMap RoomOfReference(const web::Reference& reference) override;
  void AddReference(const web::Actor& actor, const std::string& scan_id, const std::string& reason,
                    web::Done done) override;
  void PlanReference(const web::Actor& actor, const std::string& id, int revision,
                     const web::ReferencePlan& plan, web::Done done) override;
  void ApproveReference(const web::Actor& actor, const std::string& id, int revision,
                        const std::string& digest, web::Done done) override;

 private:
  [[nodiscard]] std::optional<web::Scan> ScanOf(const std::string& scan_id);

  Appliance& appliance_;
  StoreAccess& store_;
};

}  // namespace plumb
