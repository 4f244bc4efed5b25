// SPDX-License-Identifier: Apache-2.0
// The accounts of the users of the page, and the displays in the room that may follow the
// appliance.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/database/store_database.hpp"
#include "web/model/account.hpp"

namespace plumb {

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class UserStore {
 public:
  explicit UserStore(StoreDatabase& database) : database_(database) {}

  [[nodiscard]] std::vector<User> List();  ///< By name.
  [[nodiscard]] std::optional<User> Find(const std::string& name);
  /// kConflict for a name that another account has.
  void Add(const Actor& actor, const User& user);
  /// kConflict if no enabled engineer would be left.
  void Change(const Actor& actor, const UserChange& wanted);
  [[nodiscard]] std::optional<SecondFactor> SecondFactorOf(const std::string& name);
  /// As AccountService::SetSecondFactor().
  void SetSecondFactor(const Actor& actor, const std::string& name,
                       const std::optional<SecondFactor>& expected,
                       const std::optional<SecondFactor>& wanted, const std::string& action);
  /// As AccountService::FindPin() and SetPin().
  [[nodiscard]] std::optional<std::string> PinOf(const std::string& name);
  void SetPin(const Actor& actor, const std::string& name, const std::optional<std::string>& hash);
  /// Empty if none were chosen.
  [[nodiscard]] Preferences PreferencesOf(const std::string& name);
  /// Without an entry in the log. kNotFound for a name that no account has.
  void SetPreferences(const std::string& name, const Preferences& preferences);

 private:
  StoreDatabase& database_;
};

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class DisplayStore {
 public:
  explicit DisplayStore(StoreDatabase& database) : database_(database) {}

  [[nodiscard]] std::vector<Display> List();
  std::string Add(const Actor& actor, const Display& display);  ///< Returns the id.
  /// Adds the display of the provisioning file. Its key counts once: false, and nothing is changed,
  /// if it was added before, even if the display has been removed since.
  bool AddProvisioned(const Display& display);
  void Remove(const Actor& actor, const std::string& id);

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
