// The accounts of the users of the page.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/records/store_database.hpp"
#include "web/service/service_types.hpp"

namespace plumb {

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class UserStore {
 public:
  explicit UserStore(StoreDatabase& database) : database_(database) {}

  [[nodiscard]] std::vector<web::User> List();  ///< By name.
  [[nodiscard]] std::optional<web::User> Find(const std::string& name);
  /// kConflict for a name that another account has.
  void Add(const web::Actor& actor, const web::User& user);
  /// kConflict if no enabled engineer would be left.
  void Change(const web::Actor& actor, const web::UserChange& wanted);
  /// Empty if none were chosen.
  [[nodiscard]] web::Preferences PreferencesOf(const std::string& name);
  /// Without an entry in the log. kNotFound for a name that no account has.
  void SetPreferences(const std::string& name, const web::Preferences& preferences);

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
