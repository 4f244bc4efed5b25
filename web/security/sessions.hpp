// SPDX-License-Identifier: Apache-2.0
// Sessions of logged-in users. They are kept in memory only, so a restart logs everybody off.
#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "web/model/account.hpp"
#include "web/security/permissions.hpp"

namespace plumb::web {

struct Session {
  std::string user;
  Role role = Role::kTechnician;
  std::string csrf_token;  ///< Every change must carry it in a header.
  std::chrono::steady_clock::time_point begun;
  std::chrono::steady_clock::time_point last_used;
  bool ended = false;  ///< Set once it is over, for remaining holders.
  /// The password was chosen by somebody else: until the user has changed it nothing else is
  /// allowed.
  bool must_change_password = false;
  std::string id = {};       ///< By which its owner ends it; worthless as a cookie.
  std::string address = {};  ///< Of the browser that logged in.
  /// Of an authenticator that is being set up; empty: none is.
  std::string offered_secret = {};
  /// Opened with a PIN or a badge: the rights that a technician has, too, and no others.
  bool is_quick = false;

  [[nodiscard]] bool May(Permission permission) const {
    return web::May(role, permission) && (!is_quick || web::May(Role::kTechnician, permission));
  }
};

class Sessions {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  struct Opened {
    std::string token;  ///< For the cookie; only its hash is kept.
    std::shared_ptr<Session> session;
  };
  /// Ends the least recently used one if there are too many, of this user or of all.
  [[nodiscard]] Opened Open(const User& user, const std::string& address, TimePoint now);
  /// Null if unknown or over. @param touch  Counts as a use, which restarts the idle time.
  [[nodiscard]] std::shared_ptr<Session> Find(const std::string& token, TimePoint now, bool touch);
  void End(const std::shared_ptr<Session>& session);
  /// Ends the sessions of a user who was disabled, or whose role or password changed.
  /// @param but  Is kept; may be null.
  void EndAllOf(const std::string& user, const std::shared_ptr<Session>& but);
  /// Ends expired sessions.
  void Expire(TimePoint now);

  void SetLimits(std::chrono::seconds idle, std::chrono::seconds whole);
  /// The idle time of a role: that of the settings, but no longer than 30 minutes for a physicist
  /// and 10 for an engineer, who may change more.
  [[nodiscard]] std::chrono::seconds IdleOf(Role role) const;
  /// Those of a user, newest first.
  [[nodiscard]] std::vector<std::shared_ptr<Session>> Of(const std::string& user) const;
  [[nodiscard]] std::size_t size() const { return sessions_.size(); }

 private:
  [[nodiscard]] bool IsOver(const Session& session, TimePoint now) const;

  std::chrono::seconds idle_{15 * 60};
  std::chrono::seconds whole_{12 * 3600};
  std::map<std::string, std::shared_ptr<Session>> sessions_;  ///< By the hash of the token.
};

}  // namespace plumb::web
