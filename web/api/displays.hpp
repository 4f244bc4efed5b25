// SPDX-License-Identifier: Apache-2.0
// Displays in the room: pairing and recognising them.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "web/exchange/routes.hpp"
#include "web/security/sessions.hpp"
#include "web/service/account_services.hpp"

namespace plumb::web {

/// A display requests pairing and shows a code; an engineer types the code on the page; the display
/// then holds a cookie that does not expire and gives the role `display`. Used on the loop thread.
class Displays {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  Displays(DisplayService& service, bool tls, std::function<TimePoint()> now);

  void AddRoutes(Routes& routes);
  /// Pairs the screen that shows this code. For a person who has signed it.
  void Approve(const Actor& actor, const std::string& code, const std::string& name,
               const Done& done);
  void Remove(const Actor& actor, const std::string& id, const Done& done);
  /// Session of a request with a paired display's cookie; null for all others.
  [[nodiscard]] std::shared_ptr<Session> SessionOf(const Request& request);

 private:
  struct Pairing {
    std::string code;        ///< Shown on the display, typed by an engineer.
    std::string token_hash;  ///< Hash of the secret that the display keeps.
    TimePoint begun;
    std::string address;  ///< As NetworkOf() returns it.
  };

  void Begin(const Request& request, const Respond& respond);
  void Claim(const Request& request, const Respond& respond);
  [[nodiscard]] Response List();
  /// Reads the displays again after a change.
  [[nodiscard]] Done LoadThen(const Done& done);
  /// Makes room for the pairing of this address.
  void MakeRoomFor(const std::string& address);
  void Expire();
  void Load();
  [[nodiscard]] std::string cookie_name() const {
    return tls_ ? "__Host-plumb_display" : "plumb_display";
  }

  DisplayService& service_;
  bool tls_;
  std::function<TimePoint()> now_;
  std::vector<Pairing> pairings_;
  std::map<std::string, std::shared_ptr<Session>> sessions_;  ///< By the hash of the token.
  TimePoint loaded_{};                                        ///< When the database was last read.
  int wrong_codes_ = 0;  ///< Since the oldest pending pairing began.
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
};

}  // namespace plumb::web
