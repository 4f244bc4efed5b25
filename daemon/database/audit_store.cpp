// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/audit_store.hpp"

#include <algorithm>
#include <array>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "algo/base/utf8.hpp"
#include "daemon/database/stored_values.hpp"
#include "daemon/scan_files/scan_files.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

std::string Dump(const nlohmann::ordered_json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

constexpr std::array<const char*, 5> kFields = {"user", "address", "action", "subject", "detail"};

/// Key of an exported field as it is stored, where that is not UTF-8, such as a path.
std::string BytesKey(const char* field) { return fmt::format("{}_bytes", field); }

struct Kind {
  std::string_view name;
  /// Its patient's code, number and time by its id; all of them empty where it has none.
  const char* query;
};

constexpr Kind kPatient{"patient", "SELECT code, 0, 0 FROM patients WHERE id = ? AND id > 0"};
constexpr Kind kSession{"session",
                        "SELECT code, fraction, 0 FROM sessions JOIN patients ON patients.id = "
                        "patient_id WHERE sessions.id = ?"};
constexpr Kind kScan{"scan",
                     "SELECT CASE WHEN patient_id > 0 THEN code ELSE '' END, 0, 0 FROM scans JOIN "
                     "patients ON patients.id = patient_id WHERE scans.id = ?"};
constexpr Kind kReference{"reference",
                          "SELECT code, version, 0 FROM refs JOIN patients ON patients.id = "
                          "patient_id WHERE refs.id = ?"};
constexpr Kind kCheck{"check", "SELECT '', 0, time FROM checks WHERE id = ?"};

struct Prefix {
  std::string_view action;  ///< How the actions begin.
  const Kind& kind;
};

// The first one that fits counts.
constexpr std::array kPrefixes = {
    Prefix{"view.patient", kPatient},
    Prefix{"view.photo", kPatient},
    Prefix{"view.drawing", kPatient},
    Prefix{"view.reference", kReference},
    Prefix{"view.scan", kScan},
    Prefix{"download.numbers", kPatient},
    Prefix{"download.course", kPatient},
    Prefix{"download.", kScan},
    Prefix{"patient.", kPatient},
    Prefix{"session.", kSession},
    // A scan that begins has no number yet: its patient is known by the session.
    Prefix{"scan.start", kSession},
    Prefix{"scan.end", kSession},
    Prefix{"cancel", kSession},
    Prefix{"scan.", kScan},
    Prefix{"recording.", kScan},
    Prefix{"reference.", kReference},
    Prefix{"check.", kCheck},
};

/// What an entry is about, in the words that people know: a patient's code instead of a row's
/// number. Nothing where the subject is what people know already: an account, a file, no subject.
std::optional<AuditSubject> DescribeSubject(Database& database, const std::string& action,
                                            const std::string& subject) {
  const auto prefix = std::ranges::find_if(
      kPrefixes, [&](const Prefix& one) { return action.starts_with(one.action); });
  const auto id = ParseId(subject);
  if (prefix == kPrefixes.end() || !id) return std::nullopt;
  AuditSubject about;
  about.kind = prefix->kind.name;
  Statement query = database.Prepare(prefix->kind.query, *id);
  if (!query.Step()) return about;
  about.exists = true;
  about.patient_code = query.Text(0);
  about.number = static_cast<int>(query.Integer(1));
  if (query.Integer(2) > 0) about.time = FromStored(query.Integer(2));
  return about;
}

}  // namespace

void AuditStore::Log(const Actor& actor, const std::string& action, const std::string& subject,
                     const Message& detail) {
  StoreChange change(database_);
  change.Log(actor, action, subject, detail);
  change.Commit();
}

void AuditStore::Log(const Actor& actor, const std::string& action, const std::string& subject,
                     const std::string& verbatim) {
  Log(actor, action, subject, Message::Verbatim(verbatim));
}

std::vector<AuditEntry> AuditStore::Find(const AuditQuery& wanted) {
  const StoreDatabase::Held lists = database_.ForLists();
  std::vector<AuditEntry> entries = lists->All(
      "SELECT number, time, user, address, action, subject, detail FROM audit WHERE (?1 <= 0 OR "
      "number < ?1) AND substr(action, 1, length(?2)) = ?2 AND (?3 OR substr(action, 1, 5) <> "
      "'view.') ORDER BY number DESC LIMIT ?4",
      [](const Statement& row) {
        return AuditEntry{.number = row.Integer(0),
                          .time = FromStored(row.Integer(1)),
                          .user = row.Text(2),
                          .address = row.Text(3),
                          .action = row.Text(4),
                          .subject = row.Text(5),
                          .detail = DetailIn(row.Text(6))};
      },
      wanted.before, wanted.actions, wanted.views, wanted.limit);
  for (AuditEntry& entry : entries)
    entry.about = DescribeSubject(*lists, entry.action, entry.subject);
  return entries;
}

std::string AuditStore::Export() {
  const StoreDatabase::Held lists = database_.ForLists();
  Statement query = lists->Prepare(
      "SELECT number, time, user, address, action, subject, detail, chain FROM audit WHERE number "
      "> (SELECT ifnull(max(number), 0) FROM audit) - ? ORDER BY number",
      kMaxExported);
  std::string lines;
  while (query.Step()) {
    nlohmann::ordered_json line = {{"number", query.Integer(0)}, {"time_us", query.Integer(1)}};
    for (std::size_t i = 0; i < kFields.size(); ++i) {
      const std::string stored = query.Text(static_cast<int>(i) + 2), shown = ValidUtf8(stored);
      line[kFields[i]] = shown;
      if (shown != stored)
        line[BytesKey(kFields[i])] = std::vector<std::uint8_t>(stored.begin(), stored.end());
    }
    line["chain"] = query.Text(7);
    lines += Dump(line) + "\n";
  }
  return lines;
}

AuditHead CheckAuditExport(std::string_view lines) {
  AuditHead head;
  bool is_chained = false;
  while (!lines.empty()) {
    const std::size_t end = std::min(lines.find('\n'), lines.size());
    const nlohmann::json line = ParseBoundedJson(lines.substr(0, end));
    lines.remove_prefix(std::min(end + 1, lines.size()));
    std::array<std::string, kFields.size()> fields;
    std::int64_t number = 0, time_us = 0;
    std::string chain;
    try {
      number = line.at("number").get<std::int64_t>();
      time_us = line.at("time_us").get<std::int64_t>();
      for (std::size_t i = 0; i < fields.size(); ++i) {
        fields[i] = line.at(kFields[i]).get<std::string>();
        const auto bytes = line.find(BytesKey(kFields[i]));
        if (bytes == line.end()) continue;
        const auto raw = bytes->get<std::vector<std::uint8_t>>();
        const std::string stored(raw.begin(), raw.end());
        // A text that the bytes do not give is not the one that the chain covers.
        if (ValidUtf8(stored) == fields[i]) fields[i] = stored;
      }
      chain = line.at("chain").get<std::string>();
    } catch (const nlohmann::json::exception&) {
      throw DataError(say::store::LogNoEntry(head.number));
    }
    const bool is_first = head.number == 0;
    const std::string expected = Sha256Of(ChainText(head.chain, number, time_us, fields));
    is_chained = is_chained || !chain.empty();
    const bool follows = is_first || number == head.number + 1;
    const bool cannot_know = is_first && number != 1;
    if (!follows || (is_chained && !cannot_know && chain != expected))
      throw DataError(say::store::LogEntryChanged(follows ? number : head.number + 1));
    head = {.number = number, .chain = is_chained ? chain : expected};
  }
  return head;
}

AuditHead AuditStore::Head() {
  const auto read = [](const Statement& row) {
    return AuditHead{.number = row.Integer(0), .chain = row.Text(1)};
  };
  return database_.ForRows()
      ->First("SELECT number, chain FROM audit ORDER BY number DESC LIMIT 1", read)
      .value_or(AuditHead{});
}

std::optional<std::int64_t> AuditStore::FirstBroken() {
  const StoreDatabase::Held lists = database_.ForLists();
  // Read first: more may be written meanwhile.
  const std::int64_t given =
      lists->FirstInteger("SELECT seq FROM sqlite_sequence WHERE name = 'audit'").value_or(0);
  std::string chain;
  std::int64_t last = 0;
  bool has_begun = false;
  Statement query = lists->Prepare(kAuditRows);
  while (query.Step()) {
    chain = ChainOf(query, chain);
    has_begun = has_begun || !query.Text(7).empty();
    if (query.Integer(0) != last + 1 || (has_begun && query.Text(7) != chain)) return last + 1;
    last = query.Integer(0);
  }
  return last >= given ? std::nullopt : std::optional(last + 1);  // entries at the end are missing
}

}  // namespace plumb
