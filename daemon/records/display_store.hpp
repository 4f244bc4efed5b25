// The displays in the room that may follow the appliance.
#pragma once

#include <string>
#include <vector>

#include "daemon/records/store_database.hpp"
#include "web/service/service_types.hpp"

namespace plumb {

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class DisplayStore {
 public:
  explicit DisplayStore(StoreDatabase& database) : database_(database) {}

  [[nodiscard]] std::vector<web::Display> List();
  std::string Add(const web::Actor& actor, const web::Display& display);  ///< Returns the id.
  /// Adds the display of the provisioning file. Its key counts once: false, and nothing is changed,
  /// if it was added before, even if the display has been removed since.
  bool AddProvisioned(const web::Display& display);
  void Remove(const web::Actor& actor, const std::string& id);

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
