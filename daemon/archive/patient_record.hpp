// SPDX-License-Identifier: Apache-2.0
// The rows of one patient as JSON, for export and import.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "daemon/database/database.hpp"

namespace plumb {

/// The tables of a patient, in the order in which rows can be inserted.
inline constexpr const char* kPatientTables[] = {"patients", "sessions", "scans",
                                                 "results",  "refs",     "scan_files"};

/// A column as stated by the database.
struct ColumnOf {
  std::string name, type;
  bool is_required = false;  ///< Has no default and may not be NULL.
  bool may_be_null = false;
};
[[nodiscard]] std::vector<ColumnOf> ColumnsOf(Database& database, const std::string& table);

/// {"patients": [{"id": 3, "code": "P", ...}], ...}, without the appliance's own notes on the files
/// (`checked_at`) and without a running scan.
[[nodiscard]] nlohmann::ordered_json PatientRows(Database& database, std::int64_t patient);
/// The log's entries on the patient, its sessions, scans and references, and the last daily check
/// before each scan.
[[nodiscard]] nlohmann::ordered_json PatientEvidence(Database& database, std::int64_t patient);

/// Checks external rows against the tables: known columns of the right type, bounded numbers and
/// texts, readable plans and results, and numbers that refer to rows of the same record.
/// @throws DataError naming table and column
void CheckPatientRows(Database& database, const nlohmann::ordered_json& rows);

}  // namespace plumb
