// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/row_digests.hpp"

#include <fcntl.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/database/audit_chain.hpp"
#include "daemon/database/schema.hpp"
#include "daemon/database/stored_values.hpp"
#include "drivers/files/file_io.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kRowKeyBytes = 32;

/// What a kind's digests are made of.
struct SignedRows {
  RowKind kind;
  const char* name;
  const char* table;
  const char* id;       ///< Column of the table.
  const char* columns;  ///< Beside the id.
};

constexpr std::array<SignedRows, 9> kSignedRows = {{
    {RowKind::kAccount, "account", "users", "name",
     "users.role, users.password_hash, users.disabled, users.created_at, (SELECT "
     "keyed_digest(secret, last_step, recovery) FROM second_factors WHERE user = users.name), "
     "(SELECT hash FROM pins WHERE user = users.name)"},
    {RowKind::kDisplay, "display", "displays", "id",
     "displays.name, displays.token_hash, displays.paired_at, displays.paired_by"},
    {RowKind::kSetting, "setting", "settings", "name", "settings.value"},
    {RowKind::kTemplate, "template", "templates", "site",
     "templates.width_mm, templates.height_mm, templates.shift_mm, templates.rotation_deg, "
     "templates.changed_by, templates.posture, templates.hint"},
    {RowKind::kSession, "session", "sessions", "id",
     "sessions.patient_id, sessions.purpose, sessions.fraction, sessions.opened_at, "
     "sessions.opened_by, sessions.closed_at, sessions.closed_by, sessions.reference_id, "
     "sessions.chosen_at_version"},
    {RowKind::kReference, "reference", "refs", "id",
     "refs.patient_id, refs.version, refs.scan_id, refs.created_at, refs.created_by, "
     "refs.planned_by, refs.plan, refs.approved_by, refs.approved_at, refs.revision, "
     "refs.approved_digest, refs.source, refs.patient_hash"},
    {RowKind::kRoom, "room", "room_calibrations", "version",
     "room_calibrations.signed_at, room_calibrations.signed_by, room_calibrations.digest, "
     "room_calibrations.json"},
    {RowKind::kCheck, "check", "checks", "id",
     "checks.time, checks.user, checks.sensor_serial, checks.status, checks.json"},
    {RowKind::kBaseline, "baseline", "check_baselines", "id",
     "check_baselines.check_id, check_baselines.set_at, check_baselines.set_by"},
}};

const SignedRows& RowsOf(RowKind kind) { return kSignedRows.at(static_cast<std::size_t>(kind)); }

std::string IdOf(const SignedRows& rows) {
  return fmt::format("CAST({}.{} AS TEXT)", rows.table, rows.id);
}

/// Which rows have a digest: versions write the name of a schema before they have any.
std::string Which(const SignedRows& rows) {
  if (rows.kind != RowKind::kSetting) return "1";
  return fmt::format("settings.name <> '{}'", kUsableFromName);
}

std::string DigestOf(const SignedRows& rows) {
  return fmt::format("keyed_digest('{}', {}, {})", rows.name, IdOf(rows), rows.columns);
}

/// Statements that replace the digests of the rows for which `condition` holds.
std::string Renew(const SignedRows& rows, const std::string& condition) {
  return fmt::format(
      "INSERT INTO row_digests (kind, id, digest) SELECT '{}', {}, {} FROM {} WHERE {} AND {};",
      rows.name, IdOf(rows), DigestOf(rows), rows.table, Which(rows), condition);
}

/// Triggers of this connection alone: the schema stays as an older version knows it. In a trigger a
/// conflict is resolved as the statement that set it off says, so the old digest is deleted first.
void AddTriggers(Database& database, const SignedRows& rows, const std::string& table,
                 const std::string& id) {
  const auto forget = [&](const char* row) {
    return fmt::format("DELETE FROM row_digests WHERE kind = '{}' AND id = CAST({}.{} AS TEXT);",
                       rows.name, row, id);
  };
  const auto renew = [&](const char* row) {
    return Renew(rows, fmt::format("{}.{} = {}.{}", rows.table, rows.id, row, id));
  };
  const bool is_own = table == rows.table;
  const auto add = [&](const char* event, const std::string& statements) {
    database.Execute(
        fmt::format("CREATE TEMP TRIGGER sign_{0}_{1} AFTER {1} ON main.{0} BEGIN {2} END", table,
                    event, statements));
  };
  add("INSERT", forget("NEW") + renew("NEW"));
  add("UPDATE", forget("OLD") + forget("NEW") + renew("NEW"));
  add("DELETE", forget("OLD") + (is_own ? "" : renew("OLD")));
}

/// Until the digests are stored, the key has this name.
fs::path NewRowKey(const fs::path& state) { return state / (std::string(".") + kRowKeyFile); }

/// Only the owner can read it.
std::string MakeRowKey(const fs::path& state) {
  std::string key(kRowKeyBytes, '\0');
  randombytes_buf(key.data(), key.size());
  const fs::path made = NewRowKey(state);
  struct stat folder {};
  const auto require = [&](bool is_done) {
    if (!is_done) throw DiskRefused(DescribeWriteError(made, errno));
  };
  ::unlink(made.c_str());
  const int fd = ::open(made.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  require(fd >= 0);
  const bool is_written = ::write(fd, key.data(), key.size()) == static_cast<ssize_t>(key.size());
  require(::close(fd) == 0 && is_written);
  require(::stat(state.c_str(), &folder) == 0 &&
          (::geteuid() != 0 || ::lchown(made.c_str(), folder.st_uid, folder.st_gid) == 0));
  SyncToDisk(made);
  SyncToDisk(state);
  return key;
}

void PlaceRowKey(const fs::path& state) {
  if (::rename(NewRowKey(state).c_str(), (state / kRowKeyFile).c_str()) != 0)
    throw DiskRefused(DescribeWriteError(state / kRowKeyFile, errno));
  SyncToDisk(state);
}

bool HasDigests(Database& database) {
  return database.Has("SELECT 1 FROM sqlite_master WHERE name = 'row_digests'");
}

[[noreturn]] void RefuseRow(const SignedRows& rows, const std::string& id) {
  throw DatabaseCorrupt(say::store::RowChanged(rows.name, id, kRowsRightFile));
}

/// Settings that were saved are not replaced by the defaults because somebody deleted them.
void RequireSavedSettings(Database& database) {
  if (database.Has("SELECT 1 FROM settings WHERE name = 'settings'")) return;
  if (database.Has("SELECT 1 FROM audit WHERE action = 'settings.change' AND number > (SELECT "
                   "ifnull(max(number), 0) FROM audit WHERE action = 'system.factory_reset')"))
    RefuseRow(RowsOf(RowKind::kSetting), "settings");
}

/// @param why  Empty: without an entry in the log.
void SignAll(Database& database, const Message& why) {
  Transaction transaction(database);
  database.Execute(
      "CREATE TABLE IF NOT EXISTS row_digests (kind TEXT NOT NULL, id TEXT NOT NULL, digest TEXT "
      "NOT NULL, PRIMARY KEY (kind, id)) STRICT, WITHOUT ROWID; DELETE FROM row_digests;");
  for (const SignedRows& rows : kSignedRows) database.Execute(Renew(rows, "1"));
  if (!why.empty()) AppendAuditEntry(database, kSelf, "rows.sign", "", why);
  transaction.Commit();
}

/// Whether a version with digests has worked with the folder.
bool WereSigned(Database& database, const fs::path& state) {
  std::error_code error;
  return HasDigests(database) || fs::exists(state / kRowKeyFile, error) ||
         database.Has("SELECT 1 FROM audit WHERE action = 'rows.sign'");
}

/// Why rows that are there get their digests now; empty: they have them.
Message WhySign(Database& database, const fs::path& state, RowsAre rows) {
  std::error_code error;
  if (rows == RowsAre::kRestored) return say::store::LogRowsRestored();
  if (fs::exists(state / kRowsRightFile, error)) return say::store::LogRowsConfirmed();
  if (rows == RowsAre::kOlder || !WereSigned(database, state)) return say::store::LogRowsFirst();
  return {};
}

}  // namespace

void UseRowKey(Database& database, const fs::path& state) {
  const fs::path file = state / kRowKeyFile;
  std::error_code error;
  if (!fs::is_regular_file(fs::symlink_status(file, error)) ||
      fs::file_size(file, error) != kRowKeyBytes)
    throw DatabaseCorrupt(say::store::RowKeyGone(file.string(), kRowsRightFile));
  try {
    database.UseKey(ReadTextFile(file, kRowKeyBytes));
  } catch (const DataError& unreadable) {  // The disk's fault, not that of what is stored.
    throw DiskRefused(unreadable.message());
  }
}

void KeepRowDigests(Database& database, const fs::path& state, RowsAre rows) {
  std::error_code ignored;
  const Message why = rows == RowsAre::kNew ? Message() : WhySign(database, state, rows);
  if (rows == RowsAre::kNew || !why.empty()) {
    // What says why stays until they have them: an interrupted start begins again.
    database.UseKey(MakeRowKey(state));
    SignAll(database, why);
    PlaceRowKey(state);
    fs::remove(state / kRowsRightFile, ignored);  // valid for this start only
  } else {
    if (!fs::exists(state / kRowKeyFile, ignored) && fs::exists(NewRowKey(state), ignored))
      PlaceRowKey(state);  // a start was interrupted once the digests were stored
    UseRowKey(database, state);
    RequireAllRows(database);
  }
  database.Execute("PRAGMA temp_store = MEMORY");
  for (const SignedRows& kind : kSignedRows) AddTriggers(database, kind, kind.table, kind.id);
  for (const char* table : {"second_factors", "pins"})
    AddTriggers(database, RowsOf(RowKind::kAccount), table, "user");
}

void RequireRow(Database& database, RowKind kind, const std::string& id) {
  const SignedRows& rows = RowsOf(kind);
  static const auto kQueries = [] {
    std::array<std::string, kSignedRows.size()> queries;
    for (const SignedRows& one : kSignedRows)
      queries.at(static_cast<std::size_t>(one.kind)) = fmt::format(
          "SELECT (SELECT digest FROM row_digests WHERE kind = '{0}' AND id = {1}) IS {2} FROM "
          "{3} WHERE {3}.{4} = ?",
          one.name, IdOf(one), DigestOf(one), one.table, one.id);
    return queries;
  }();
  if (database.FirstInteger(kQueries.at(static_cast<std::size_t>(kind)), id).value_or(1) == 0)
    RefuseRow(rows, id);
}

void RequireRows(Database& database, RowKind kind) {
  const SignedRows& rows = RowsOf(kind);
  static const auto kQueries = [] {
    std::array<std::string, kSignedRows.size()> queries;
    for (const SignedRows& one : kSignedRows)
      queries.at(static_cast<std::size_t>(one.kind)) = fmt::format(
          "SELECT {1} FROM {3} WHERE {5} AND (SELECT digest FROM row_digests WHERE kind = '{0}' "
          "AND id = {1}) IS NOT {2} UNION ALL SELECT id FROM row_digests WHERE kind = '{0}' AND id "
          "NOT IN (SELECT {1} FROM {3}) LIMIT 1",
          one.name, IdOf(one), DigestOf(one), one.table, one.id, Which(one));
    return queries;
  }();
  if (const auto id = database.FirstText(kQueries.at(static_cast<std::size_t>(kind))))
    RefuseRow(rows, *id);
}

void RequireAllRows(Database& database) {
  if (!HasDigests(database)) throw DatabaseCorrupt(say::store::RowDigestsGone(kRowsRightFile));
  for (const SignedRows& rows : kSignedRows) RequireRows(database, rows.kind);
  RequireSavedSettings(database);
}

}  // namespace plumb
