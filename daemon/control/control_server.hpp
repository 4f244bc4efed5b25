// SPDX-License-Identifier: Apache-2.0
// The control socket: local clients request the status, press the button and watch events.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "daemon/control/control_protocol.hpp"
#include "daemon/loop/alive_flag.hpp"
#include "daemon/loop/event_loop.hpp"

namespace plumb {

struct ControlServerOptions {
  /// A further client replaces the one that has been without a request for longest. If all have
  /// pending requests or watch, it is rejected with the reason.
  std::size_t max_clients = 32;
  std::size_t max_waiting =
      256 << 10;  ///< Bytes that a client has not read yet, above which it is dropped.
  /// Requests of a client that wait for their answers; a further one is refused.
  int max_unanswered = 16;
};

/// Used on the loop's thread. A client that never reads, floods or sends invalid data affects only
/// its own connection.
class ControlServer {
 public:
  using Reply = std::function<void(const std::string& line)>;
  /// Answers by calling `reply` once, immediately or later on the loop's thread.
  using Handler = std::function<void(const ControlRequest& request, const Reply& reply)>;

  /// @param listening  A listening socket; ownership is taken.
  ControlServer(EventLoop& loop, int listening, Handler handler,
                const ControlServerOptions& options = {});
  ~ControlServer();
  ControlServer(const ControlServer&) = delete;
  ControlServer& operator=(const ControlServer&) = delete;

  /// To all watchers: one JSON object without its line end.
  void Broadcast(const std::string& line);

  [[nodiscard]] std::size_t num_clients() const { return clients_.size(); }

 private:
  struct Client;
  void Accept();
  /// False if no client can be dropped.
  [[nodiscard]] bool MakeRoom();
  void Read(std::uint64_t id);
  void HandleLine(std::uint64_t id, const std::string& line);
  void Send(std::uint64_t id, const std::string& line);
  void Flush(std::uint64_t id);
  void Drop(std::uint64_t id);

  EventLoop& loop_;
  int listening_;
  Handler handler_;
  ControlServerOptions options_;
  std::map<std::uint64_t, std::unique_ptr<Client>> clients_;
  std::uint64_t next_id_ = 1;
  AliveFlag alive_;  ///< For replies that arrive after this object is destroyed.
  EventLoop::Source source_;
};

}  // namespace plumb
