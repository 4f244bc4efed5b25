// SPDX-License-Identifier: Apache-2.0
#include "web/http/connection_table.hpp"

#include <algorithm>
#include <functional>
#include <map>
#include <tuple>

namespace plumb::web {
namespace {

using Group = std::vector<Connection*>;

constexpr std::chrono::seconds kTimeToAsk{1};  // for a browser to send its request, over TLS
constexpr std::size_t kOfOneBrowser = 8;       // browsers open six connections at once

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

/// The connection of the largest groups whose end does the least harm. With one connection from
/// each of many addresses all groups are equally large, and every connection is compared. One that
/// has just been made counts as busy: its request is on the way.
Connection* FromTheLargest(const std::map<std::string, Group>& groups, Connection::TimePoint now) {
  const auto harm = [&](const Connection* connection) {
    const bool is_idle = connection->receiving && now - connection->since >= kTimeToAsk;
    return std::tuple(!is_idle, connection->since);
  };
  const std::size_t size = LargestOf(groups);
  Connection* least = nullptr;
  for (const auto& [name, group] : groups) {
    if (group.size() < size) continue;
    for (Connection* connection : group)
      if (least == nullptr || harm(connection) < harm(least)) least = connection;
  }
  return least;
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
                          .begun = now,
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

Connection* ConnectionTable::NextOverLimit(Connection::TimePoint now) {
  const auto is_stranger = [](const Connection& c) { return c.user.empty(); };
  const auto anonymous = Grouped(connections_, is_stranger, &Connection::address);
  if (LargestOf(anonymous) > options_.max_strangers_per_address)
    return Leave(FromTheLargest(anonymous, now));
  const auto from_outside = Grouped(
      connections_,
      [&](const Connection& c) { return is_stranger(c) && !IsLocalAddress(c.address); },
      &Connection::address);
  if (CountOf(from_outside) > options_.max_strangers) {
    // A new connection of a logged-in browser has no user until its request is here.
    auto others = from_outside;
    for (const Connection& connection : connections_) {
      const auto same = others.find(connection.address);
      if (!is_stranger(connection) && same != others.end() && same->second.size() <= kOfOneBrowser)
        others.erase(same);
    }
    return Leave(FromTheLargest(others.empty() ? from_outside : others, now));
  }
  // Space is reserved for strangers and for this machine, so that others can still log in.
  const unsigned others = options_.max_strangers + options_.max_strangers_per_address;
  const auto logged_in = Grouped(
      connections_, [&](const Connection& c) { return !is_stranger(c); }, &Connection::user);
  if (options_.max_connections > others && CountOf(logged_in) > options_.max_connections - others)
    return Leave(FromTheLargest(logged_in, now));
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

Connection* ConnectionTable::NextOlderThan(Connection::TimePoint time) {
  const auto old =
      std::find_if(connections_.begin(), connections_.end(), [&](const Connection& connection) {
        return !connection.is_leaving && connection.begun < time;
      });
  return old == connections_.end() ? nullptr : Leave(&*old);
}

}  // namespace plumb::web
