// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/audit_chain.hpp"

#include <fmt/format.h>

#include "algo/base/bounded_json.hpp"
#include "algo/base/message_json.hpp"
#include "daemon/database/stored_values.hpp"
#include "daemon/scan_files/scan_files.hpp"

namespace plumb {

std::string ChainText(const std::string& before, std::int64_t number, std::int64_t time,
                      const std::array<std::string, 5>& fields) {
  std::string text = fmt::format("{}\n{}\n{}\n", before, number, time);
  for (const std::string& field : fields) text += fmt::format("{}:{}\n", field.size(), field);
  return text;
}

std::string ChainOf(const Statement& row, const std::string& before) {
  return Sha256Of(ChainText(before, row.Integer(0), row.Integer(1),
                            {row.Text(2), row.Text(3), row.Text(4), row.Text(5), row.Text(6)}));
}

namespace {

/// Digest of everything before the first entry that carries a chain.
std::string ChainOfUnchained(Database& database) {
  std::string chain;
  Statement query = database.Prepare(kAuditRows);
  while (query.Step() && query.Text(7).empty()) chain = ChainOf(query, chain);
  return chain;
}

/// Between a sentence and its message. JSON escapes it, so the last one is this one.
constexpr char kBeforeMessage = '\x1f';

std::string StoredDetail(const Message& detail) {
  std::string stored = detail.English();
  std::string message = MessageColumn(detail);
  // Then what a person wrote is never taken for a message.
  if (message.empty() && stored.find(kBeforeMessage) != std::string::npos)
    message = MessageJson(detail).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  if (!message.empty()) stored += kBeforeMessage + message;
  return stored;
}

}  // namespace

Message DetailIn(const std::string& stored) {
  const std::size_t end = stored.rfind(kBeforeMessage);
  if (end == std::string::npos) return Message::Verbatim(stored);
  const auto json = ParseBoundedJsonOrNothing<nlohmann::ordered_json>(stored.substr(end + 1));
  return json.is_object() ? MessageFromJson(json, stored.substr(0, end))
                          : Message::Verbatim(stored);
}

void AppendAuditEntry(Database& database, const Actor& actor, const std::string& action,
                      const std::string& subject, const Message& detail) {
  const std::string stored = StoredDetail(detail);
  const std::int64_t number =
      database.FirstInteger("SELECT seq FROM sqlite_sequence WHERE name = 'audit'").value_or(0) + 1;
  std::string before =
      database.FirstText("SELECT chain FROM audit ORDER BY number DESC LIMIT 1").value_or("");
  if (before.empty()) before = ChainOfUnchained(database);
  const std::int64_t time = StoredNow();
  database.Run(
      "INSERT INTO audit (number, time, user, address, action, subject, detail, chain) VALUES "
      "(?, ?, ?, ?, ?, ?, ?, ?)",
      number, time, actor.user, actor.address, action, subject, stored,
      Sha256Of(
          ChainText(before, number, time, {actor.user, actor.address, action, subject, stored})));
}

}  // namespace plumb
