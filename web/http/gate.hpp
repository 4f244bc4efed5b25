// The checks that every request passes before its handler: host, route, login, role, origin, token,
// type.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "web/http/router.hpp"
#include "web/service/background_work.hpp"

namespace plumb::web {

/// Which session a request belongs to. Belongs to the loop thread.
class SessionLookup {
 public:
  virtual ~SessionLookup() = default;
  /// The session of a request, by its cookie; null without one. @param touch  Counts as a use.
  [[nodiscard]] virtual std::shared_ptr<Session> SessionOf(const Request& request, bool touch) = 0;
  /// True while there is no account yet.
  [[nodiscard]] virtual bool needs_setup() const = 0;
  /// Of the server's certificate; empty without TLS.
  [[nodiscard]] virtual std::string tls_fingerprint() const = 0;
};

class Gate {
 public:
  Gate(const Router& router, SessionLookup& sessions, std::vector<std::string> host_names, bool tls)
      : router_(router), sessions_(sessions), host_names_(std::move(host_names)), tls_(tls) {}

  /// Judges a request by its head; fills in its session and arguments. The route, or the refusal.
  [[nodiscard]] std::variant<const Route*, Response> Admit(Request& request) const;
  /// Called with the whole body. Runs the handler; what it throws becomes an answer.
  static void Handle(const Route& route, const Request& request, const Respond& respond);

 private:
  [[nodiscard]] bool IsOwnPage(const Request& request) const;
  [[nodiscard]] Response NotLoggedIn() const;

  const Router& router_;
  SessionLookup& sessions_;
  std::vector<std::string> host_names_;
  bool tls_;
};

/// An answer that takes its time: made by `make` on the background thread for reads; what it throws
/// becomes an answer as in Gate::Handle().
/// @param name  Of the route.
void RespondAside(BackgroundWork& background, const std::string& name,
                  std::function<Response()> make, const Respond& respond);

/// Adds a GET route of lists or files, which are not read on the loop. `background` must outlive
/// the router.
void AddAside(Router& router, BackgroundWork& background, const char* pattern,
              Permission permission, std::function<Response(const Request&)> make);

/// The headers of every answer, from one place. @param tls  The answer goes over TLS: the browser
/// is to come back by TLS only.
void AddSecurityHeaders(Response& response, bool tls);

}  // namespace plumb::web
