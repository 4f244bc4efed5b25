// SPDX-License-Identifier: Apache-2.0
#include "web/api/look_back.hpp"

#include <functional>

namespace plumb::web {
namespace {

constexpr int kPage = 200;
constexpr int kPages = 25;

/// From the newest entry whose action has this prefix to older ones, until `look` has seen enough.
void Walk(AuditLog& log, const std::string& actions,
          const std::function<bool(const AuditEntry&)>& look) {
  std::int64_t before = 0;
  for (int page = 0; page < kPages; ++page) {
    const std::vector<AuditEntry> entries = log.Audit({before, kPage, actions});
    for (const AuditEntry& entry : entries) {
      if (look(entry)) return;
      before = entry.number;
    }
    if (entries.size() < kPage) return;
  }
}

}  // namespace

LoginHistory LoginsBefore(AuditLog& log, const std::string& user, WallClock::time_point before) {
  LoginHistory history;
  Walk(log, "login", [&](const AuditEntry& entry) {
    if (entry.user != user) return false;
    if (entry.action == "login.failed") ++history.failed;
    if (entry.action != "login" || entry.time >= before) return false;
    history.last = entry;
    return true;
  });
  constexpr std::size_t kMost = 20;
  Walk(log, "user.", [&](const AuditEntry& entry) {
    if (history.last && entry.number < history.last->number) return true;
    if (entry.subject == user && entry.action != "user.add") history.changes.push_back(entry);
    return history.changes.size() >= kMost;
  });
  return history;
}

std::optional<AuditEntry> LastEntry(AuditLog& log, const std::string& action) {
  const std::vector<AuditEntry> newest = log.Audit({0, 1, action});
  return newest.empty() ? std::nullopt : std::optional(newest.front());
}

}  // namespace plumb::web
