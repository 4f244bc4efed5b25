// The settings that a person changes on the page.
#pragma once

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

}  // namespace plumb
