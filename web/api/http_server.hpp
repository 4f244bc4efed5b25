// SPDX-License-Identifier: Apache-2.0
// The appliance's HTTP server, driven by the daemon's event loop.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "web/http/router.hpp"
#include "web/http/server_options.hpp"
#include "web/service/services.hpp"

namespace plumb::web {

/// Serves the page, the API under /api/v1 (web/openapi.yaml), the event stream and GET /health.
///
/// Used on the loop thread: everything is called there and calls the services there. Passwords are
/// hashed on a separate thread. Signals must be blocked before construction. Destruction closes
/// every connection; later completions are dropped.
class HttpServer {
 public:
  /// Listens at once; nothing is answered before the first Run().
  /// @throws IoError with address and reason, DataError for the TLS files.
  HttpServer(const Services& services, HttpServerOptions options);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// An epoll descriptor: wait for EPOLLIN on it, then call Run().
  [[nodiscard]] int fd() const;
  /// Does all pending work; never waits.
  void Run();
  /// Call Run() after that time even if fd() is not readable; nothing: not necessary. Ask again
  /// after each Run().
  [[nodiscard]] std::optional<std::chrono::milliseconds> timeout() const;

  [[nodiscard]] std::uint16_t port() const;
  [[nodiscard]] const std::vector<Route>& routes() const;
  /// "XXXX-XXXX" while there is no account: it permits creating the first one, an engineer. Print
  /// it where only the owner can see it.
  [[nodiscard]] std::optional<std::string> setup_code() const;
  /// As Accounts::presence_code().
  [[nodiscard]] std::string presence_code();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb::web
