// Accounts of people.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "web/service/change.hpp"
#include "web/service/service_types.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class AccountService {
 public:
  virtual ~AccountService() = default;

  /// Why no account can be looked up (safe mode, a damaged database); empty if they can. Unless it
  /// is empty, an empty list of users does not mean that there are none.
  [[nodiscard]] virtual std::string WhyUnreadable() = 0;
  [[nodiscard]] virtual std::vector<User> Users() = 0;  ///< By name.
  [[nodiscard]] virtual std::optional<User> FindUser(const std::string& name) = 0;
  virtual void AddUser(const Actor& actor, const User& user,
                       Done done) = 0;  ///< kConflict if the name is taken.
  /// kConflict if no enabled engineer would be left, or the account has changed.
  virtual void ChangeUser(const Actor& actor, const UserChange& change, Done done) = 0;
  /// Empty if none were chosen, or they cannot be read.
  [[nodiscard]] virtual Preferences PreferencesOf(const std::string& name) = 0;
  /// Keeps what the actor chose. It is not logged.
  virtual void SetPreferences(const Actor& actor, const Preferences& preferences, Done done) = 0;
};

}  // namespace plumb::web
