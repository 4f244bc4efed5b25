#include "web/http/connection_table.hpp"

#include <algorithm>
#include <functional>
#include <map>
#include <tuple>

namespace plumb::web {
namespace {

using Group = std::vector<Connection*>;

/// The connections that satisfy a condition, grouped by a name.
std::map<std::string, Group> Grouped(std::list<Connection>& connections,
                                     const std::function<bool(const Connection&)>& belongs,
                                     std::string Connection::*name) {
  std::map<std::string, Group> groups;
  for (Connection& connection : connections) {
    if (!connection.is_leaving && belongs(connection))
      groups[connection.*name].push_back(&connection);
  }
  return groups;
}

/// The connection of the largest group whose end does the least harm.
Connection* FromTheLargest(const std::map<std::string, Group>& groups) {
  const auto largest = std::max_element(
      groups.begin(), groups.end(),
      [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); });
  const auto harm = [](const Connection* connection) {
    const bool is_waiting = connection->receiving && !connection->has_head;
    return std::tuple(!is_waiting, connection->since);
  };
  return *std::min_element(
      largest->second.begin(), largest->second.end(),
      [&](const Connection* a, const Connection* b) { return harm(a) < harm(b); });
}

std::size_t CountOf(const std::map<std::string, Group>& groups) {
  std::size_t count = 0;
  for (const auto& [name, group] : groups) count += group.size();
  return count;
}

std::size_t LargestOf(const std::map<std::string, Group>& groups) {
  std::size_t largest = 0;
  for (const auto& [name, group] : groups) largest = std::max(largest, group.size());
  return largest;
}

Connection* Leave(Connection* connection) {
  connection->is_leaving = true;
  return connection;
}

}  // namespace

bool IsLocalAddress(const std::string& address) {
  return address == "127.0.0.1" || address == "::1" || address == "::ffff:127.0.0.1";
}

Connection* ConnectionTable::Add(int fd, const std::string& address, Connection::TimePoint now) {
  connections_.push_back({.fd = fd,
                          .address = address,
                          .since = now,
                          .receiving = true,
                          .has_head = false,
                          .uploading = false,
                          .user = {},
                          .is_leaving = false});
  return &connections_.back();
}

void ConnectionTable::Remove(const Connection* connection) {
  connections_.remove_if([&](const Connection& held) { return &held == connection; });
}

Connection* ConnectionTable::NextOverLimit() {
  const auto is_stranger = [](const Connection& c) { return c.user.empty(); };
  const auto anonymous = Grouped(connections_, is_stranger, &Connection::address);
  if (LargestOf(anonymous) > options_.max_strangers_per_address)
    return Leave(FromTheLargest(anonymous));
  const auto from_outside = Grouped(
      connections_,
      [&](const Connection& c) { return is_stranger(c) && !IsLocalAddress(c.address); },
      &Connection::address);
  if (CountOf(from_outside) > options_.max_strangers) return Leave(FromTheLargest(from_outside));
  // Space is reserved for strangers and for this machine, so that others can still log in.
  const unsigned others = options_.max_strangers + options_.max_strangers_per_address;
  const auto logged_in = Grouped(
      connections_, [&](const Connection& c) { return !is_stranger(c); }, &Connection::user);
  if (options_.max_connections > others && CountOf(logged_in) > options_.max_connections - others)
    return Leave(FromTheLargest(logged_in));
  return nullptr;
}

bool ConnectionTable::IsLate(const Connection& connection, Connection::TimePoint now) const {
  if (!connection.receiving) return false;
  const auto held = now - connection.since;
  if (connection.uploading) return held > options_.upload_limit;
  if (connection.user.empty() && !connection.has_head && held > options_.header_limit) return true;
  return held > options_.request_limit;
}

Connection* ConnectionTable::NextLate(Connection::TimePoint now) {
  const auto late =
      std::find_if(connections_.begin(), connections_.end(), [&](const Connection& connection) {
        return !connection.is_leaving && IsLate(connection, now);
      });
  return late == connections_.end() ? nullptr : Leave(&*late);
}

}  // namespace plumb::web
