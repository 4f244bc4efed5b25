// SPDX-License-Identifier: Apache-2.0
// Keeps track of connections and selects those to close when there are too many or a request takes
// too long.
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
  std::string address;      ///< Address of the peer.
  TimePoint begun;          ///< Time at which it was made.
  TimePoint since;          ///< Time at which its present request could have begun.
  bool receiving = true;    ///< Its request is not complete yet.
  bool has_head = false;    ///< Line and headers of its request have arrived.
  bool uploading = false;   ///< Its body is a bundle.
  std::string user;         ///< User of the session of its last request; empty if there is none.
  bool is_leaving = false;  ///< Already selected to be closed.
};

/// True for this machine itself.
[[nodiscard]] bool IsLocalAddress(const std::string& address);

/// All connections of a server. Used on the loop thread.
class ConnectionTable {
 public:
  explicit ConnectionTable(const HttpServerOptions& options) : options_(options) {}

  /// Valid until Remove().
  Connection* Add(int fd, const std::string& address, Connection::TimePoint now);
  void Remove(const Connection* connection);
  [[nodiscard]] bool empty() const { return connections_.empty(); }

  /// A connection to close so that the limits hold, or null. It is marked as leaving: repeat until
  /// there is none. Connections of the addresses or persons with the most are closed first; among
  /// these one that waits for a request before one that is new or being answered, and the oldest
  /// first. A stranger's few connections from the address of a logged-in browser stay while there
  /// are others.
  [[nodiscard]] Connection* NextOverLimit(Connection::TimePoint now);
  /// Returns in the same way a connection whose request has not arrived in time.
  [[nodiscard]] Connection* NextLate(Connection::TimePoint now);
  /// Returns in the same way a connection that was made before `time`.
  [[nodiscard]] Connection* NextOlderThan(Connection::TimePoint time);

 private:
  [[nodiscard]] bool IsLate(const Connection& connection, Connection::TimePoint now) const;

  const HttpServerOptions& options_;
  std::list<Connection> connections_;
};

}  // namespace plumb::web
