// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/schema.hpp"

#include <algorithm>
#include <string>

#include <fmt/format.h>

#include "algo/base/parse_number.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

// Times are microseconds since 1970, UTC. Order is given by ids, which only increase, because
// clocks may step.
//
// The schema of version 0.1.0. An approval names the plan that was read, by refs.revision.
constexpr const char* kSchema3 = R"sql(
CREATE TABLE patients (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  code TEXT NOT NULL UNIQUE,
  site TEXT NOT NULL,
  created_at INTEGER NOT NULL,
  wiping INTEGER NOT NULL DEFAULT 0
) STRICT;
CREATE TABLE scans (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  patient_id INTEGER NOT NULL REFERENCES patients(id) ON DELETE CASCADE,
  reference_id INTEGER REFERENCES refs(id) ON DELETE SET NULL,
  purpose TEXT NOT NULL CHECK (purpose IN ('fraction', 'reference', 'daily_check')),
  outcome TEXT NOT NULL CHECK (outcome IN ('running', 'done', 'cancelled', 'failed')),
  failure TEXT NOT NULL DEFAULT '',
  started_at INTEGER NOT NULL,
  finished_at INTEGER,
  sensor_serial TEXT NOT NULL,
  swept_area_m2 REAL NOT NULL DEFAULT 0,
  reason TEXT NOT NULL DEFAULT '',
  accepted_by TEXT NOT NULL DEFAULT '',
  has_folder INTEGER NOT NULL DEFAULT 0
) STRICT;
CREATE INDEX scans_of_patient ON scans(patient_id, id);
CREATE TABLE results (
  scan_id INTEGER PRIMARY KEY REFERENCES scans(id) ON DELETE CASCADE,
  json TEXT NOT NULL
) STRICT;
CREATE TABLE refs (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  patient_id INTEGER NOT NULL REFERENCES patients(id) ON DELETE CASCADE,
  version INTEGER NOT NULL,
  scan_id INTEGER NOT NULL REFERENCES scans(id),
  created_at INTEGER NOT NULL,
  created_by TEXT NOT NULL,
  planned_by TEXT NOT NULL,
  reason TEXT NOT NULL,
  plan TEXT NOT NULL,
  approved_by TEXT NOT NULL DEFAULT '',
  approved_at INTEGER,
  revision INTEGER NOT NULL DEFAULT 1,
  UNIQUE (patient_id, version)
) STRICT;
CREATE TRIGGER refs_immutable BEFORE UPDATE ON refs WHEN OLD.approved_by <> ''
  BEGIN SELECT RAISE(ABORT, 'an approved reference is never changed'); END;
CREATE TRIGGER refs_stay BEFORE DELETE ON refs
  WHEN OLD.approved_by <> '' AND EXISTS (SELECT 1 FROM patients WHERE id = OLD.patient_id AND wiping = 0)
  BEGIN SELECT RAISE(ABORT, 'an approved reference goes only with its patient'); END;
CREATE TABLE users (
  name TEXT PRIMARY KEY,
  role TEXT NOT NULL CHECK (role IN ('technician', 'physicist', 'engineer')),
  password_hash TEXT NOT NULL,
  disabled INTEGER NOT NULL DEFAULT 0,
  created_at INTEGER NOT NULL
) STRICT;
CREATE TABLE audit (
  number INTEGER PRIMARY KEY AUTOINCREMENT,
  time INTEGER NOT NULL,
  user TEXT NOT NULL,
  address TEXT NOT NULL,
  action TEXT NOT NULL,
  subject TEXT NOT NULL,
  detail TEXT NOT NULL
) STRICT;
CREATE TRIGGER audit_no_update BEFORE UPDATE ON audit BEGIN SELECT RAISE(ABORT, 'the audit log is append-only'); END;
CREATE TRIGGER audit_no_delete BEFORE DELETE ON audit BEGIN SELECT RAISE(ABORT, 'the audit log is append-only'); END;
CREATE TABLE settings (name TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT;
-- The daily checks and the baseline for comparisons. Neither is ever changed.
CREATE TABLE checks (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  time INTEGER NOT NULL,
  user TEXT NOT NULL,
  sensor_serial TEXT NOT NULL,
  status TEXT NOT NULL CHECK (status IN ('passed', 'failed', 'no_baseline')),
  json TEXT NOT NULL
) STRICT;
CREATE INDEX checks_by_time ON checks(status, time);
CREATE TABLE check_baselines (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  check_id INTEGER NOT NULL REFERENCES checks(id),
  set_at INTEGER NOT NULL,
  set_by TEXT NOT NULL
) STRICT;
CREATE TRIGGER checks_no_update BEFORE UPDATE ON checks BEGIN SELECT RAISE(ABORT, 'checks are append-only'); END;
CREATE TRIGGER checks_no_delete BEFORE DELETE ON checks BEGIN SELECT RAISE(ABORT, 'checks are append-only'); END;
)sql";

// What came after 0.1.0. Scans without a session belong to patient 0, whose number and code no
// request can name.
constexpr const char* kFrom3To9 = R"sql(
-- Treatment sessions, known facts at the beginning of a scan, the reason for its acceptance, and
-- paired displays.
CREATE TABLE sessions (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  patient_id INTEGER NOT NULL REFERENCES patients(id) ON DELETE CASCADE,
  purpose TEXT NOT NULL CHECK (purpose IN ('fraction', 'reference')),
  fraction INTEGER NOT NULL DEFAULT 0,
  opened_at INTEGER NOT NULL,
  opened_by TEXT NOT NULL,
  closed_at INTEGER,
  closed_by TEXT NOT NULL DEFAULT ''
) STRICT;
CREATE INDEX sessions_of_patient ON sessions(patient_id, id);
ALTER TABLE scans ADD COLUMN session_id INTEGER REFERENCES sessions(id) ON DELETE SET NULL;
CREATE INDEX scans_of_session ON scans(session_id);
ALTER TABLE scans ADD COLUMN accepted_reason TEXT NOT NULL DEFAULT '';
ALTER TABLE scans ADD COLUMN sensor_on_s REAL;
ALTER TABLE scans ADD COLUMN check_overdue INTEGER NOT NULL DEFAULT 0;
INSERT INTO patients (id, code, site, created_at) VALUES (0, '(unassigned)', '', 0);
CREATE TABLE displays (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  name TEXT NOT NULL,
  token_hash TEXT NOT NULL UNIQUE,
  paired_at INTEGER NOT NULL,
  paired_by TEXT NOT NULL
) STRICT;
-- Digests of stored files; the numbers of scans that were removed on purpose, so that others count
-- as missing; a digest chain in the audit log. A scan whose files 0.1.0 did not find keeps its folder
-- from now on.
CREATE TABLE scan_files (
  scan_id INTEGER NOT NULL REFERENCES scans(id) ON DELETE CASCADE,
  path TEXT NOT NULL,
  bytes INTEGER NOT NULL,
  sha256 TEXT NOT NULL,
  PRIMARY KEY (scan_id, path)
) STRICT, WITHOUT ROWID;
CREATE TRIGGER scan_files_no_update BEFORE UPDATE ON scan_files
  BEGIN SELECT RAISE(ABORT, 'the digest of a stored file is never changed'); END;
CREATE TABLE removed_scans (id INTEGER PRIMARY KEY) STRICT;
ALTER TABLE scans ADD COLUMN unavailable TEXT NOT NULL DEFAULT '';
ALTER TABLE scans ADD COLUMN checked_at INTEGER NOT NULL DEFAULT 0;
ALTER TABLE audit ADD COLUMN chain TEXT NOT NULL DEFAULT '';
UPDATE scans SET has_folder = 1, unavailable = failure, failure = ''
  WHERE outcome = 'done' AND has_folder = 0;
-- Notes on patients, the archive, and templates of plans.
ALTER TABLE patients ADD COLUMN note TEXT NOT NULL DEFAULT '';
ALTER TABLE patients ADD COLUMN archived INTEGER NOT NULL DEFAULT 0;
CREATE TABLE templates (
  site TEXT PRIMARY KEY COLLATE NOCASE,
  width_mm REAL NOT NULL,
  height_mm REAL NOT NULL,
  shift_mm REAL NOT NULL,
  rotation_deg REAL NOT NULL,
  changed_by TEXT NOT NULL
) STRICT;
-- The room's axes as they were signed. The newest calibration is used; none is ever changed.
CREATE TABLE room_calibrations (
  version INTEGER PRIMARY KEY AUTOINCREMENT,
  signed_at INTEGER NOT NULL,
  signed_by TEXT NOT NULL,
  digest TEXT NOT NULL,
  json TEXT NOT NULL
) STRICT;
CREATE TRIGGER room_calibrations_no_update BEFORE UPDATE ON room_calibrations
  BEGIN SELECT RAISE(ABORT, 'a signed calibration of the room is never changed'); END;
CREATE TRIGGER room_calibrations_no_delete BEFORE DELETE ON room_calibrations
  BEGIN SELECT RAISE(ABORT, 'a signed calibration of the room is never removed'); END;
-- When a result was accepted; for earlier ones the time comes from the audit log.
ALTER TABLE scans ADD COLUMN accepted_at INTEGER;
UPDATE scans SET accepted_at = (SELECT MAX(time) FROM audit WHERE subject = printf('%06d', scans.id)
  AND action IN ('scan.accept', 'scan.accept_outside')) WHERE accepted_by <> '';
-- What each person chose of the page. Drafts that nobody has planned say so: 0.1.0 named who had
-- scanned them.
CREATE TABLE preferences (
  user TEXT PRIMARY KEY REFERENCES users(name) ON DELETE CASCADE,
  language TEXT NOT NULL,
  theme TEXT NOT NULL
) STRICT;
UPDATE refs SET planned_by = '' WHERE approved_by = '' AND revision = 1
  AND reason NOT LIKE 'new plan of version %';
)sql";

// What came after 0.2.0: messages in any language beside the English sentences. A version that
// knows the sentences only, after an update was rolled back, may replace one: then the message is
// not of it any more.
constexpr const char* kFrom9To10 = R"sql(
ALTER TABLE scans ADD COLUMN failure_message TEXT NOT NULL DEFAULT '';
ALTER TABLE scans ADD COLUMN unavailable_message TEXT NOT NULL DEFAULT '';
CREATE TRIGGER scans_unavailable_message AFTER UPDATE OF unavailable ON scans
  WHEN NEW.unavailable <> OLD.unavailable AND NEW.unavailable_message = OLD.unavailable_message
  BEGIN UPDATE scans SET unavailable_message = '' WHERE id = NEW.id; END;
-- The authenticator of a person who has one, and the hashes of recovery codes, one a line. A version
-- that does not know it asks for the password alone.
CREATE TABLE second_factors (
  user TEXT PRIMARY KEY REFERENCES users(name) ON DELETE CASCADE,
  secret TEXT NOT NULL,
  last_step INTEGER NOT NULL,
  recovery TEXT NOT NULL
) STRICT;
-- The hash of a person's PIN or badge. A version that does not know it asks for the password.
CREATE TABLE pins (
  user TEXT PRIMARY KEY REFERENCES users(name) ON DELETE CASCADE,
  hash TEXT NOT NULL
) STRICT;
-- The digest that an approval signed, from the log for earlier ones; never changed once it is there.
-- 0.2.0 leaves it empty.
ALTER TABLE refs ADD COLUMN approved_digest TEXT NOT NULL DEFAULT '';
DROP TRIGGER refs_immutable;
UPDATE refs SET approved_digest = ifnull((SELECT substr(detail, 8) FROM audit
  WHERE action = 'reference.approve' AND subject = refs.id AND detail LIKE 'sha256 %'
  AND length(detail) = 71 ORDER BY number DESC LIMIT 1), '') WHERE approved_by <> '';
CREATE TRIGGER refs_immutable BEFORE UPDATE ON refs WHEN OLD.approved_by <> ''
  BEGIN SELECT RAISE(ABORT, 'an approved reference is never changed'); END;
-- What a session for fractions compares with: the reference that was approved when it was opened.
-- NULL, as 0.2.0 leaves it: the newest approved one.
ALTER TABLE sessions ADD COLUMN reference_id INTEGER REFERENCES refs(id) ON DELETE SET NULL;
-- What a reference was made of, with the keyed hash of the Patient ID in the files of
-- a planning CT; and the newest approved version when a person chose what a session compares with.
ALTER TABLE refs ADD COLUMN source TEXT NOT NULL DEFAULT 'sweep';
ALTER TABLE refs ADD COLUMN patient_hash TEXT NOT NULL DEFAULT '';
ALTER TABLE sessions ADD COLUMN chosen_at_version INTEGER NOT NULL DEFAULT 0;
-- How a patient is set up, what was drawn, and a photo taken with the sensor: JPEG, base64. The photo
-- is the last column: what stands behind it cannot be read without it.
ALTER TABLE patients ADD COLUMN immobilisation TEXT NOT NULL DEFAULT '';
ALTER TABLE patients ADD COLUMN alert TEXT NOT NULL DEFAULT '';
ALTER TABLE patients ADD COLUMN sheet_revision INTEGER NOT NULL DEFAULT 0;
ALTER TABLE patients ADD COLUMN drawing TEXT NOT NULL DEFAULT '';
ALTER TABLE patients ADD COLUMN has_photo INTEGER NOT NULL DEFAULT 0;
ALTER TABLE patients ADD COLUMN photo TEXT NOT NULL DEFAULT '';
-- The posture that plans of a site begin with, and what is said to whoever sweeps.
ALTER TABLE templates ADD COLUMN posture TEXT NOT NULL DEFAULT '';
ALTER TABLE templates ADD COLUMN hint TEXT NOT NULL DEFAULT '';
-- Backups that were made, when their bytes were last compared with the digest (verified_at: and were
-- the same), and the scans of which each one holds every file as it was stored.
CREATE TABLE backups (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  place TEXT NOT NULL UNIQUE,
  sha256 TEXT NOT NULL,
  made_at INTEGER NOT NULL,
  checked_at INTEGER NOT NULL DEFAULT 0,
  verified_at INTEGER NOT NULL DEFAULT 0
) STRICT;
CREATE TABLE backup_scans (
  backup_id INTEGER NOT NULL REFERENCES backups(id) ON DELETE CASCADE,
  scan_id INTEGER NOT NULL,
  PRIMARY KEY (scan_id, backup_id)
) STRICT, WITHOUT ROWID;
CREATE INDEX scans_of_backup ON backup_scans(backup_id);
-- Removals for age or room that were announced, and scans in the bin.
CREATE TABLE removals (
  scan_id INTEGER NOT NULL REFERENCES scans(id) ON DELETE CASCADE,
  kind TEXT NOT NULL,
  announced_at INTEGER NOT NULL,
  PRIMARY KEY (scan_id, kind)
) STRICT, WITHOUT ROWID;
CREATE TABLE bin (
  scan_id INTEGER PRIMARY KEY,
  patient_id INTEGER NOT NULL,
  binned_at INTEGER NOT NULL
) STRICT;
-- Accepted results that an archive has stored, and which one.
CREATE TABLE archived (
  scan_id INTEGER PRIMARY KEY REFERENCES scans(id) ON DELETE CASCADE,
  archive TEXT NOT NULL,
  stored_at INTEGER NOT NULL
) STRICT;
)sql";

/// Schemas in between were never released.
struct Step {
  int from, to;
  const char* sql;
};
constexpr Step kSteps[] = {{0, 3, kSchema3}, {3, 9, kFrom3To9}, {9, kSchemaVersion, kFrom9To10}};

/// Whether a newer database states that programs with this schema can use it.
bool IsUsable(Database& database) {
  if (!database.Has("SELECT 1 FROM sqlite_master WHERE name = 'settings'")) return false;
  const std::string text =
      database.FirstText("SELECT value FROM settings WHERE name = ?", kUsableFromName).value_or("");
  const std::optional<int> oldest = ParseNumber<int>(text);
  return oldest && *oldest > 0 && *oldest <= kSchemaVersion;
}

void NoteUsableFrom(Database& database) {
  database.Run("INSERT OR REPLACE INTO settings (name, value) VALUES (?, ?)", kUsableFromName,
               std::to_string(kUsableFromSchema));
}

}  // namespace

void RequireUsable(Database& database) {
  const int version = static_cast<int>(database.FirstInteger("PRAGMA user_version").value_or(0));
  const bool is_known =
      std::ranges::any_of(kSteps, [&](const Step& step) { return step.to == version; });
  if (version > kSchemaVersion && !IsUsable(database))
    throw DatabaseCorrupt(say::store::DatabaseNewer(version, kSchemaVersion));
  if (version <= kSchemaVersion && !is_known)
    throw DatabaseCorrupt(say::store::DatabaseUnknown(version));
  for (const char* table : {"patients", "scans", "results", "refs", "users", "audit", "settings",
                            "checks", "check_baselines"})
    (void)database.Has(std::string("SELECT 1 FROM ") + table);
}

void Migrate(Database& database) {
  int version = static_cast<int>(database.FirstInteger("PRAGMA user_version").value_or(0));
  if (version > kSchemaVersion && IsUsable(database)) return;
  for (const Step& step : kSteps) {
    if (version != step.from) continue;
    Transaction transaction(database);
    database.Execute(step.sql);
    if (step.to == kSchemaVersion) NoteUsableFrom(database);
    database.Execute(fmt::format("PRAGMA user_version = {}", step.to));
    transaction.Commit();
    version = step.to;
  }
  if (version == kSchemaVersion) return;
  if (version > kSchemaVersion)
    throw DatabaseCorrupt(say::store::DatabaseNewer(version, kSchemaVersion));
  throw DatabaseCorrupt(say::store::DatabaseUnknown(version));
}

}  // namespace plumb
