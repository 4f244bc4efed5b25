// The control socket: local clients ask for the status, press the button, watch what happens.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "daemon/control/control_protocol.hpp"
#include "daemon/loop/event_loop.hpp"

namespace plumb {

struct ControlServerOptions {
  /// One more takes the place of who has waited longest without a question; where all are waited
  /// for or watch, it is turned away with the reason.
  std::size_t max_clients = 32;
  std::size_t max_waiting =
      256 << 10;  ///< Bytes that a client has not read yet; then it is dropped.
};

/// Belongs to the loop's thread. A client that never reads, floods or sends nonsense costs at most
/// its own connection.
class ControlServer {
 public:
  using Reply = std::function<void(const std::string& line)>;
  /// Answers by calling `reply` once, then or later on the loop's thread.
  using Handler = std::function<void(const ControlRequest& request, const Reply& reply)>;

  /// @param listening  A listening socket; taken over.
  ControlServer(EventLoop& loop, int listening, Handler handler,
                const ControlServerOptions& options = {});
  ~ControlServer();
  ControlServer(const ControlServer&) = delete;
  ControlServer& operator=(const ControlServer&) = delete;

  /// To all who watch: one JSON object without its line end.
  void Broadcast(const std::string& line);

  [[nodiscard]] std::size_t num_clients() const { return clients_.size(); }

 private:
  struct Client;
  void Accept();
  /// False where nobody can go.
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
  std::shared_ptr<bool> alive_ =
      std::make_shared<bool>(true);  ///< For replies that come after this object is gone.
  EventLoop::Source source_;
};

}  // namespace plumb
