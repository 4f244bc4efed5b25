// Templates of plans, one for each treatment site.
#pragma once

#include <string>
#include <vector>

#include "daemon/records/store_database.hpp"
#include "web/service/service_types.hpp"

namespace plumb {

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class TemplateStore {
 public:
  explicit TemplateStore(StoreDatabase& database) : database_(database) {}

  [[nodiscard]] std::vector<web::PlanTemplate> List();  ///< By site.
  /// Replaces the template of that site. kConflict above 100 sites.
  void Set(const web::Actor& actor, const web::PlanTemplate& wanted);
  void Remove(const web::Actor& actor, const std::string& site);

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
