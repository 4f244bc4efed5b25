// SPDX-License-Identifier: Apache-2.0
// Accounts of people, displays in the room, and the record of all actions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "web/model/account.hpp"
#include "web/model/audit.hpp"
#include "web/model/change.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class AccountService {
 public:
  virtual ~AccountService() = default;

  /// Why no account can be looked up (safe mode, a damaged database); empty if they can. Unless it
  /// is empty, an empty list of users does not mean that there are none.
  [[nodiscard]] virtual Message WhyUnreadable() = 0;
  [[nodiscard]] virtual std::vector<User> Users() = 0;  ///< By name.
  [[nodiscard]] virtual std::optional<User> FindUser(const std::string& name) = 0;
  virtual void AddUser(const Actor& actor, const User& user,
                       Done done) = 0;  ///< kConflict if the name is taken.
  /// kConflict if no enabled engineer would be left, or the account has changed.
  virtual void ChangeUser(const Actor& actor, const UserChange& change, Done done) = 0;
  /// Nothing if the person has none, or it cannot be read: User::has_second_factor tells.
  [[nodiscard]] virtual std::optional<SecondFactor> FindSecondFactor(const std::string& name) = 0;
  /// kConflict if the second factor is not `expected` any more.
  /// @param wanted  Nothing: the person has none from now on.
  /// @param action  In the log; empty: a code was used, which is not logged.
  virtual void SetSecondFactor(const Actor& actor, const std::string& name,
                               const std::optional<SecondFactor>& expected,
                               const std::optional<SecondFactor>& wanted, const std::string& action,
                               Done done) = 0;
  /// Hash of the person's PIN or badge, as that of a password; nothing if the person has none, or
  /// it cannot be read.
  [[nodiscard]] virtual std::optional<std::string> FindPin(const std::string& name) = 0;
  /// @param hash  Nothing: the person has none from now on.
  virtual void SetPin(const Actor& actor, const std::string& name,
                      const std::optional<std::string>& hash, Done done) = 0;
  /// Empty if none were chosen, or they cannot be read.
  [[nodiscard]] virtual Preferences PreferencesOf(const std::string& name) = 0;
  /// Keeps what the actor chose. It is not logged.
  virtual void SetPreferences(const Actor& actor, const Preferences& preferences, Done done) = 0;
};

/// The rules of services.hpp hold.
class DisplayService {
 public:
  virtual ~DisplayService() = default;

  [[nodiscard]] virtual std::vector<Display> Displays() = 0;
  virtual void AddDisplay(const Actor& actor, const Display& display, Done done) = 0;
  virtual void RemoveDisplay(const Actor& actor, const std::string& id, Done done) = 0;
};

/// The rules of services.hpp hold.
class AuditLog {
 public:
  virtual ~AuditLog() = default;

  /// For logins and other actions that do not change the store. May be written later, in order.
  virtual void Log(const Actor& actor, const std::string& action, const std::string& subject,
                   const Message& detail) = 0;
  /// Newest first (background).
  [[nodiscard]] virtual std::vector<AuditEntry> Audit(const AuditQuery& query) = 0;
  /// The log as it is stored, with the digests by which it can be checked: one JSON object a line,
  /// oldest first (background).
  [[nodiscard]] virtual std::string ExportAudit() = 0;
};

}  // namespace plumb::web
