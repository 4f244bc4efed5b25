// SPDX-License-Identifier: Apache-2.0
// The checks that every request passes before its handler: host, route, login, role, origin, token,
// type.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "algo/base/message.hpp"
#include "web/http/router.hpp"
#include "web/service/background_work.hpp"

namespace plumb::web {

/// Finds the session of a request. Used on the loop thread.
class SessionLookup {
 public:
  virtual ~SessionLookup() = default;
  /// The session of a request, by its cookie; null without one. @param touch  Counts as a use.
  [[nodiscard]] virtual std::shared_ptr<Session> SessionOf(const Request& request, bool touch) = 0;
  /// True while there is no account yet.
  [[nodiscard]] virtual bool needs_setup() const = 0;
  /// Why nobody can log in since the start (safe mode); empty if people can.
  [[nodiscard]] virtual const Message& accounts_fault() const = 0;
  /// Fingerprint of the server's certificate; empty without TLS.
  [[nodiscard]] virtual std::string tls_fingerprint() const = 0;
  /// Time until that certificate ends, negative afterwards; nothing without TLS.
  [[nodiscard]] virtual std::optional<std::chrono::seconds> CertificateLeft() const = 0;
};

class Gate {
 public:
  Gate(const Router& router, SessionLookup& sessions, std::vector<std::string> host_names, bool tls)
      : router_(router), sessions_(sessions), host_names_(std::move(host_names)), tls_(tls) {}

  /// Checks the head of a request and fills in its session and arguments. Returns the route or the
  /// refusal.
  [[nodiscard]] std::variant<const Route*, Response> Admit(Request& request) const;
  /// Called with the complete body. Runs the handler; its exceptions become an answer.
  static void Handle(const Route& route, const Request& request, const Respond& respond);
  [[nodiscard]] std::optional<std::chrono::seconds> CertificateLeft() const {
    return sessions_.CertificateLeft();
  }

 private:
  /// Why a change is refused that no page of this unit has asked for; empty if one has.
  [[nodiscard]] Message WhyNotOwnPage(const Request& request) const;
  [[nodiscard]] Response NotLoggedIn() const;

  const Router& router_;
  SessionLookup& sessions_;
  std::vector<std::string> host_names_;
  bool tls_;
};

/// Runs the rest of a handler later, on the loop. Its exceptions become the answer as in
/// Gate::Handle(), so that one unreadable record does not end the loop.
/// @param name  Of the route.
void RespondGuarded(const std::string& name, const std::function<void()>& rest,
                    const Respond& respond);

/// A slow answer: made by `make` on the background thread for reads; its exceptions become an
/// answer as in Gate::Handle().
/// @param name  Of the route.
void RespondInBackground(BackgroundWork& background, const std::string& name,
                         std::function<Response()> make, const Respond& respond);

/// The headers of every answer.
/// @param certificate_left  The answer is sent over TLS, and the browser must use TLS from now on,
///        but not for longer than the certificate is valid: it would give nobody a way past an
///        ended one, not even to replace it. Nothing: without TLS.
void AddSecurityHeaders(Response& response, std::optional<std::chrono::seconds> certificate_left);

}  // namespace plumb::web
