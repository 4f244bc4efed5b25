// Sessions of logged-in users. They are kept in memory only, so a restart logs everybody off.
#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <string>

#include "web/model/account.hpp"

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
};

/// Random text from that many bytes of the system's generator, in letters, digits, '-' and '_'.
[[nodiscard]] std::string RandomToken(std::size_t bytes);

/// A code that people type: that many letters and digits that are not easily confused, of 5 bits
/// each, with a hyphen in the middle, as in "AB3D-7KQM".
[[nodiscard]] std::string RandomCode(int letters);

/// The hash by which a display's token is stored, in hexadecimal digits.
[[nodiscard]] std::string StoredHashOf(const std::string& token);

/// That many bytes from the same generator.
[[nodiscard]] std::string RandomBytes(std::size_t bytes);

class Sessions {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  struct Opened {
    std::string token;  ///< For the cookie; only its hash is kept.
    std::shared_ptr<Session> session;
  };
  /// Ends the least recently used one if there are too many.
  [[nodiscard]] Opened Open(const User& user, TimePoint now);
  /// Null if unknown or over. @param touch  Counts as a use, which restarts the idle time.
  [[nodiscard]] std::shared_ptr<Session> Find(const std::string& token, TimePoint now, bool touch);
  void End(const std::shared_ptr<Session>& session);
  /// Ends the sessions of a user who was disabled, or whose role or password changed.
  /// @param but  Is kept; may be null.
  void EndAllOf(const std::string& user, const std::shared_ptr<Session>& but);
  /// Ends expired sessions.
  void Expire(TimePoint now);

  void SetLimits(std::chrono::seconds idle, std::chrono::seconds whole);
  [[nodiscard]] std::size_t size() const { return sessions_.size(); }

 private:
  [[nodiscard]] bool IsOver(const Session& session, TimePoint now) const;

  std::chrono::seconds idle_{15 * 60};
  std::chrono::seconds whole_{12 * 3600};
  std::map<std::string, std::shared_ptr<Session>> sessions_;  ///< By the hash of the token.
};

}  // namespace plumb::web
