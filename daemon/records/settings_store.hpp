// The settings that a person changes on the page, and the templates of plans, one for each
// treatment site.
#pragma once

#include <string>
#include <vector>

#include "daemon/records/store_database.hpp"
#include "web/service/service_types.hpp"

namespace plumb {

/// Thread-safe. @throws IoError and its kinds; DataError for settings that cannot be read.
class SettingsStore {
 public:
  explicit SettingsStore(StoreDatabase& database) : database_(database) {}

  [[nodiscard]] web::Settings Get();
  void Change(const web::Actor& actor, const web::Settings& settings);

 private:
  StoreDatabase& database_;
};

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
