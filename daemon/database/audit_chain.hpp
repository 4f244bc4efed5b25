// SPDX-License-Identifier: Apache-2.0
// The chain of the audit log's entries: each carries the digest of the one before and itself.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "algo/base/message.hpp"
#include "daemon/database/database.hpp"
#include "web/model/account.hpp"

namespace plumb {

/// One entry of the log as the chain covers it; lengths separate the fields.
[[nodiscard]] std::string ChainText(const std::string& before, std::int64_t number,
                                    std::int64_t time, const std::array<std::string, 5>& fields);

/// The rows that ChainOf() takes, oldest first.
inline constexpr const char* kAuditRows =
    "SELECT number, time, user, address, action, subject, detail, chain FROM audit ORDER BY number";

/// The digest that follows `before` with this row.
[[nodiscard]] std::string ChainOf(const Statement& row, const std::string& before);

/// Adds an entry as part of the open transaction. Each entry carries the SHA-256 of the previous
/// entry and itself. The detail is stored as its English sentence and, after the character U+001F,
/// the message in JSON; a text that came from outside, as it is. So the digests are those of 0.2.0,
/// which knew sentences only, and cover both.
void AppendAuditEntry(Database& database, const Actor& actor, const std::string& action,
                      const std::string& subject, const Message& detail);

/// The message of a stored detail; verbatim for one of 0.2.0.
[[nodiscard]] Message DetailIn(const std::string& stored);

}  // namespace plumb
