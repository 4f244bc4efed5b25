// SPDX-License-Identifier: Apache-2.0
// Entries of the audit log.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "algo/base/message.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {

/// An entry's subject in terms that people know, as the records are now.
struct AuditSubject {
  std::string kind;          ///< "patient", "session", "scan", "reference" or "check".
  bool exists = false;       ///< False: it was deleted since.
  std::string patient_code;  ///< Empty: none.
  int number = 0;            ///< Fraction of a session, version of a reference; 0: none.
  std::optional<WallClock::time_point> time = {};  ///< Time of a check.
};

struct AuditEntry {
  std::int64_t number = 0;  ///< Assigned by the store; increases.
  WallClock::time_point time;
  std::string user;
  std::string address;
  std::string action;   ///< "login", "reference.approve".
  std::string subject;  ///< Id of the changed object.
  Message detail;
  std::optional<AuditSubject> about = {};  ///< Not set: people know the subject by its id.
};

/// Selection of entries.
struct AuditQuery {
  std::int64_t before = 0;  ///< Only entries older than this number; 0: from the newest one.
  int limit = 100;
  std::string actions = {};  ///< Prefix of their actions; empty: all.
  bool views = true;         ///< Include views of patient data.
};

}  // namespace plumb
