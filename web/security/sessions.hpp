// Who is logged in. In memory only: a restart logs everybody off.
#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <string>

#include "web/service/service_types.hpp"

namespace plumb::web {

struct Session {
  std::string user;
  Role role = Role::kTechnician;
  std::string csrf_token;  ///< Every change carries it in a header.
  std::chrono::steady_clock::time_point begun;
  std::chrono::steady_clock::time_point last_used;
  bool ended = false;  ///< Set once it is over, for who still holds it.
  /// Somebody else chose the password: until the person has changed it nothing else is allowed.
  bool must_change_password = false;
};

/// Random text of that many bytes from the system's generator, in letters, digits, '-' and '_'.
[[nodiscard]] std::string RandomToken(std::size_t bytes);

/// That many bytes of the same.
[[nodiscard]] std::string RandomBytes(std::size_t bytes);

class Sessions {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  struct Opened {
    std::string token;  ///< For the cookie; only its hash is kept.
    std::shared_ptr<Session> session;
  };
  /// Ends the least recently used one where there are too many.
  [[nodiscard]] Opened Open(const User& user, TimePoint now);
  /// Null where unknown or over. @param touch  Counts as a use: idle time starts again.
  [[nodiscard]] std::shared_ptr<Session> Find(const std::string& token, TimePoint now, bool touch);
  void End(const std::shared_ptr<Session>& session);
  /// Of a user that was disabled, or whose role or password changed. @param but  Goes on; may be
  /// null.
  void EndAllOf(const std::string& user, const std::shared_ptr<Session>& but);
  /// Ends those that are over.
  void Expire(TimePoint now);

  void SetLimits(std::chrono::seconds idle, std::chrono::seconds whole);
  [[nodiscard]] std::size_t size() const { return sessions_.size(); }

 private:
  [[nodiscard]] bool IsOver(const Session& session, TimePoint now) const;

  std::chrono::seconds idle_{15 * 60};
  std::chrono::seconds whole_{12 * 3600};
  std::map<std::string, std::shared_ptr<Session>> sessions_;  ///< By the token's hash.
};

}  // namespace plumb::web
