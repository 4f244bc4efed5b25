// Who is connected, and who has to go when there are too many or a request takes too long.
#pragma once

#include <chrono>
#include <list>
#include <string>

#include "web/http/server_options.hpp"

namespace plumb::web {

/// One TCP connection.
struct Connection {
  using TimePoint = std::chrono::steady_clock::time_point;

  int fd = -1;
  std::string address;      ///< Of the other side.
  TimePoint since;          ///< When its present request could have begun.
  bool receiving = true;    ///< Its request is not whole yet.
  bool has_head = false;    ///< Line and headers of its request are there.
  bool uploading = false;   ///< Its body is a bundle.
  std::string user;         ///< Of the session that its last request belonged to; empty: none.
  bool is_leaving = false;  ///< It has been chosen already.
};

/// True for this machine itself.
[[nodiscard]] bool IsLocalAddress(const std::string& address);

/// All connections of a server. Belongs to the loop thread.
class ConnectionTable {
 public:
  explicit ConnectionTable(const HttpServerOptions& options) : options_(options) {}

  /// Lives until Remove().
  Connection* Add(int fd, const std::string& address, Connection::TimePoint now);
  void Remove(const Connection* connection);
  [[nodiscard]] bool empty() const { return connections_.empty(); }

  /// One connection that has to go so that the limits hold, or null. Marked as leaving: ask until
  /// there is none. Those of the address, or of the person, with the most go first; of these one
  /// that waits for a request before one that is being answered, and the oldest first.
  [[nodiscard]] Connection* NextOverLimit();
  /// Likewise one whose request is not there in time.
  [[nodiscard]] Connection* NextLate(Connection::TimePoint now);

 private:
  [[nodiscard]] bool IsLate(const Connection& connection, Connection::TimePoint now) const;

  const HttpServerOptions& options_;
  std::list<Connection> connections_;
};

}  // namespace plumb::web
