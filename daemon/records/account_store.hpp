// The accounts of the users of the page, and the displays in the room that may follow the
// appliance.
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
