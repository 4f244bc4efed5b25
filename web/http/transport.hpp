// SPDX-License-Identifier: Apache-2.0
// Connects libmicrohttpd to the loop: connections, limits, bodies, files, streams.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <vector>

#include "web/http/connection_table.hpp"
#include "web/http/event_hub.hpp"
#include "web/http/gate.hpp"
#include "web/http/server_options.hpp"
#include "web/service/background_work.hpp"

struct MHD_Daemon;

namespace plumb::web {

struct Exchange;
class ServedCertificate;

/// Reports the current activity to HttpServerOptions::doing during its lifetime.
class ScopedLoopLabel {
 public:
  ScopedLoopLabel(const HttpServerOptions& options, std::string_view what) : tell_(options.doing) {
    if (tell_) tell_(what);
  }
  ~ScopedLoopLabel() {
    if (tell_) tell_({});
  }
  ScopedLoopLabel(const ScopedLoopLabel&) = delete;
  ScopedLoopLabel& operator=(const ScopedLoopLabel&) = delete;

 private:
  const std::function<void(std::string_view)>& tell_;
};

/// Carries requests to the gate and answers back. Used on the loop thread.
class Transport {
 public:
  /// @param background  Writes files.
  /// @param send_initial_events  Writes the first events into a new stream.
  Transport(const HttpServerOptions& options, BackgroundWork& background, const Router& router,
            SessionLookup& sessions, EventHub& hub,
            std::function<void(EventStream&)> send_initial_events);
  ~Transport();
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;

  [[nodiscard]] int fd() const { return epoll_fd_; }
  /// Readable after Wake(): something is ready to be sent.
  [[nodiscard]] int wake_fd() const { return wake_fd_; }
  void Run();
  void Wake() const;
  [[nodiscard]] std::optional<std::chrono::milliseconds> timeout() const;
  /// Closes connections whose request has not arrived in time.
  void CutLate();
  /// Closes connections that were made before `time`, and their streams: browsers make new ones.
  void CutOlderThan(Connection::TimePoint time);
  /// For new TLS connections; open ones are unchanged.
  /// @throws DataError if it cannot be served.
  void Serve(const TlsIdentity& identity);
  [[nodiscard]] bool has_connections() const { return !connections_.empty(); }
  [[nodiscard]] std::uint16_t port() const { return port_; }

  /// Callbacks of libmicrohttpd, whose types only the .cpp knows.
  struct Callbacks;

 private:
  void Start(int listen_fd);
  void RunLibrary();
  [[nodiscard]] std::optional<std::chrono::milliseconds> LibraryTimeout() const;

  HttpServerOptions options_;
  BackgroundWork& background_;
  Gate gate_;
  EventHub& hub_;
  std::function<void(EventStream&)> send_initial_events_;
  ConnectionTable connections_;
  std::list<Exchange*> exchanges_;
  std::weak_ptr<UploadFile> upload_;  ///< One at a time.
  bool has_whole_upload_ = false;     ///< It is not being sent any more, but worked on.
  std::size_t unsent_bytes_ = 0;      ///< Size of the bodies that the library holds.
  /// The last one is served. Handshakes in progress may still use earlier ones, so they are kept;
  /// they are few, because a person replaces them.
  std::vector<std::unique_ptr<ServedCertificate>> certificates_;
  std::uint16_t port_ = 0;
  int wake_fd_ = -1;
  int epoll_fd_ = -1;
  MHD_Daemon* daemon_ = nullptr;
};

}  // namespace plumb::web
