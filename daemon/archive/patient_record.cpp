// SPDX-License-Identifier: Apache-2.0
#include "daemon/archive/patient_record.hpp"

#include <algorithm>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/plain_text.hpp"
#include "daemon/archive/summed_folder.hpp"
#include "daemon/database/store_json.hpp"
#include "daemon/scan_files/scan_files.hpp"
#include "web/model/limits.hpp"
#include "words/backup.hpp"

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxRows = 200'000, kMaxText = std::size_t{64} << 10,
                      kMaxJson = std::size_t{4} << 20,
                      kMaxPhotoText = 4 * (kMaxPhoto / 3 + 1);  // base64
constexpr std::int64_t kMaxInteger = std::int64_t{1} << 53;  // sufficient for times in nanoseconds

struct Query {
  const char *table, *rows;
};
constexpr Query kQueries[] = {
    {"patients", "SELECT * FROM patients WHERE id = ?1"},
    {"sessions", "SELECT * FROM sessions WHERE patient_id = ?1 ORDER BY id"},
    {"scans", "SELECT * FROM scans WHERE patient_id = ?1 AND outcome <> 'running' ORDER BY id"},
    {"results",
     "SELECT * FROM results WHERE scan_id IN (SELECT id FROM scans WHERE patient_id = ?1 AND "
     "outcome <> 'running') ORDER BY scan_id"},
    {"refs", "SELECT * FROM refs WHERE patient_id = ?1 ORDER BY id"},
    {"scan_files",
     "SELECT * FROM scan_files WHERE scan_id IN (SELECT id FROM scans WHERE patient_id = ?1 AND "
     "outcome <> 'running') ORDER BY scan_id, path"},
};
constexpr Query kLog = {
    "audit",
    "SELECT * FROM audit WHERE (action LIKE 'patient.%' AND subject = CAST(?1 AS TEXT)) OR "
    "((action LIKE 'session.%' OR action IN ('scan.start', 'scan.end', 'cancel')) AND subject IN "
    "(SELECT CAST(id AS TEXT) FROM sessions WHERE patient_id = ?1)) OR (action LIKE 'reference.%' "
    "AND subject IN (SELECT CAST(id AS TEXT) FROM refs WHERE patient_id = ?1)) OR ((action LIKE "
    "'scan.%' OR action LIKE 'recording.%') AND action NOT IN ('scan.start', 'scan.end') AND "
    "subject IN (SELECT printf('%06d', id) FROM scans WHERE patient_id = ?1)) ORDER BY number"};
constexpr Query kChecks = {
    "checks",
    "SELECT * FROM checks WHERE id IN (SELECT (SELECT max(earlier.id) FROM checks AS earlier WHERE "
    "earlier.sensor_serial = scans.sensor_serial AND earlier.time <= scans.started_at) FROM scans "
    "WHERE patient_id = ?1) ORDER BY id"};

Json Rows(Database& database, const Query& query, std::int64_t patient) {
  const std::vector<ColumnOf> columns = ColumnsOf(database, query.table);
  Json rows = Json::array();
  Statement row = database.Prepare(query.rows, patient);
  while (row.Step()) {
    Json values = Json::object();
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const int at = static_cast<int>(i);
      if (columns[i].name == "checked_at") continue;
      Json& value = values[columns[i].name];
      if (row.IsNull(at)) continue;
      if (columns[i].type == "INTEGER") {
        value = row.Integer(at);
      } else if (columns[i].type == "REAL") {
        value = row.Real(at);
      } else {
        value = row.Text(at);
        // A row without a message is the same as one of 0.2.0, which has no such column.
        if (value == "" && columns[i].name.ends_with("_message")) values.erase(columns[i].name);
      }
    }
    rows.push_back(std::move(values));
  }
  return rows;
}

[[noreturn]] void Refuse(const std::string& table, const std::string& column, Message found) {
  throw DataError(say::backup::RecordWrong(table, column, std::move(found)));
}

void CheckValue(const std::string& table, const ColumnOf& column, const Json& value) {
  if (value.is_null()) {
    if (!column.may_be_null) Refuse(table, column.name, say::backup::RecordNothing());
    return;
  }
  if (column.type == "INTEGER") {
    if (!value.is_number_integer() || value.get<std::int64_t>() > kMaxInteger ||
        value.get<std::int64_t>() < -kMaxInteger)
      Refuse(table, column.name, say::backup::RecordNoInteger());
    return;
  }
  if (column.type == "REAL") {
    if (!value.is_number()) Refuse(table, column.name, say::backup::RecordNoNumber());
    return;
  }
  const bool is_json = column.name == "json" || column.name == "plan";
  const std::size_t most = is_json ? kMaxJson : column.name == "photo" ? kMaxPhotoText : kMaxText;
  if (!value.is_string() || value.get_ref<const std::string&>().size() > most ||
      value.get_ref<const std::string&>().find('\0') != std::string::npos ||
      (!is_json && !IsPlainText(value.get_ref<const std::string&>(), /*allow_lines=*/true)))
    Refuse(table, column.name, say::backup::RecordNoText());
}

void CheckRow(const std::string& table, const std::vector<ColumnOf>& columns, const Json& row) {
  if (!row.is_object()) throw DataError(say::backup::RecordNoRow(table));
  for (const auto& item : row.items()) {
    const std::string& name = item.key();
    const auto column = std::find_if(columns.begin(), columns.end(),
                                     [&name](const ColumnOf& c) { return c.name == name; });
    if (column == columns.end()) Refuse(table, name.substr(0, 40), say::backup::RecordUnknown());
    CheckValue(table, *column, item.value());
  }
  for (const ColumnOf& column : columns) {
    if (column.is_required && !row.contains(column.name))
      Refuse(table, column.name, say::backup::RecordNothing());
  }
}

/// The ids of a table's rows.
std::set<std::int64_t> NumbersIn(const Json& rows, const char* table) {
  std::set<std::int64_t> ids;
  for (const Json& row : rows.at(table)) {
    const std::int64_t id = row.value("id", std::int64_t{0});
    if (id <= 0 || !ids.insert(id).second) Refuse(table, "id", say::backup::RecordNumberTwice());
  }
  return ids;
}

void CheckNumber(const Json& row, const char* table, const char* column,
                 const std::set<std::int64_t>& known, bool may_be_null) {
  const Json value = row.value(column, Json());
  if (value.is_null() && may_be_null) return;
  if (!value.is_number_integer() || !known.contains(value.get<std::int64_t>()))
    Refuse(table, column, say::backup::RecordNoSuchRow());
}

void CheckMeaning(const Json& rows) {
  for (const Json& result : rows.at("results")) (void)SummaryOf(result.value("json", ""));
  for (const Json& reference : rows.at("refs")) {
    (void)ParsePlan(reference.value("plan", ""));
    if (!Named<ReferenceSource>(reference.value("source", "sweep")))
      Refuse("refs", "source", say::backup::RecordUnknown());
  }
  for (const Json& scan : rows.at("scans")) {
    if (scan.value("outcome", "") == "running")
      Refuse("scans", "outcome", say::backup::RecordRunning());
  }
  for (const Json& file : rows.at("scan_files")) {
    const std::string sum = file.value("sha256", "");
    const bool is_sum =
        sum.size() == 64 && sum.find_first_not_of("0123456789abcdef") == std::string::npos;
    if (!IsPlainPath(file.value("path", "")) || !is_sum || file.value("bytes", -1) < 0)
      Refuse("scan_files", "path", say::backup::RecordNoFile());
  }
}

void CheckReferences(const Json& rows) {
  const std::set<std::int64_t> patients = NumbersIn(rows, "patients"),
                               sessions = NumbersIn(rows, "sessions"),
                               scans = NumbersIn(rows, "scans"), refs = NumbersIn(rows, "refs");
  for (const Json& row : rows.at("sessions")) {
    CheckNumber(row, "sessions", "patient_id", patients, false);
    CheckNumber(row, "sessions", "reference_id", refs, true);
  }
  for (const Json& row : rows.at("scans")) {
    CheckNumber(row, "scans", "patient_id", patients, false);
    CheckNumber(row, "scans", "reference_id", refs, true);
    CheckNumber(row, "scans", "session_id", sessions, true);
  }
  for (const Json& row : rows.at("results")) CheckNumber(row, "results", "scan_id", scans, false);
  for (const Json& row : rows.at("refs")) {
    CheckNumber(row, "refs", "patient_id", patients, false);
    CheckNumber(row, "refs", "scan_id", scans, false);
  }
  for (const Json& row : rows.at("scan_files"))
    CheckNumber(row, "scan_files", "scan_id", scans, false);
}

}  // namespace

std::vector<ColumnOf> ColumnsOf(Database& database, const std::string& table) {
  return database.All(fmt::format("PRAGMA table_info({})", table), [](const Statement& info) {
    const bool is_key = info.Integer(5) != 0, not_null = info.Integer(3) != 0;
    return ColumnOf{.name = info.Text(1),
                    .type = info.Text(2),
                    .is_required = is_key || (not_null && info.IsNull(4)),
                    .may_be_null = !is_key && !not_null};
  });
}

Json PatientRows(Database& database, std::int64_t patient) {
  Json rows = Json::object();
  for (const Query& query : kQueries) rows[query.table] = Rows(database, query, patient);
  return rows;
}

Json PatientEvidence(Database& database, std::int64_t patient) {
  return {{"audit", Rows(database, kLog, patient)}, {"checks", Rows(database, kChecks, patient)}};
}

void CheckPatientRows(Database& database, const Json& rows) {
  if (!rows.is_object()) throw DataError(say::backup::RecordNoRows());
  for (const Query& query : kQueries) {
    const auto table = rows.find(query.table);
    if (table == rows.end() || !table->is_array() || table->size() > kMaxRows)
      throw DataError(say::backup::RecordNoTable(query.table));
    const std::vector<ColumnOf> columns = ColumnsOf(database, query.table);
    for (const Json& row : *table) CheckRow(query.table, columns, row);
  }
  if (rows.size() != std::size(kQueries) || rows.at("patients").size() != 1)
    throw DataError(say::backup::RecordNotOne());
  CheckReferences(rows);
  CheckMeaning(rows);
}

}  // namespace plumb
