// Treatment sessions: the patient on the couch.
#pragma once

#include <optional>
#include <string>

#include "daemon/records/store_database.hpp"
#include "web/service/service_types.hpp"

namespace plumb {

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class TreatmentStore {
 public:
  explicit TreatmentStore(StoreDatabase& database) : database_(database) {}

  /// Closes the open session, if any, and opens one. Returns the id.
  std::string Open(const web::Actor& actor, const std::string& patient_id,
                   web::ScanPurpose purpose);
  void CloseAll(const web::Actor& actor);
  [[nodiscard]] std::optional<web::TreatmentSession> Opened();

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
