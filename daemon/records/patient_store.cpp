// SPDX-License-Identifier: Apache-2.0
#include "daemon/records/patient_store.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <fmt/format.h>

#include "algo/base/base64.hpp"
#include "daemon/database/row_digests.hpp"
#include "daemon/database/store_refusal.hpp"
#include "daemon/database/stored_values.hpp"
#include "web/model/limits.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

const std::string kPatientColumns =
    "SELECT id, code, site, created_at,"
    " (SELECT max(refs.id) FROM refs WHERE refs.patient_id = patients.id AND approved_by <> '' AND "
    "version ="
    "   (SELECT max(version) FROM refs AS r WHERE r.patient_id = patients.id AND r.approved_by <> "
    "'')),"
    " (SELECT count(*) FROM scans WHERE scans.patient_id = patients.id AND outcome = 'done'),"
    " (SELECT id FROM refs WHERE refs.patient_id = patients.id AND approved_by = '' AND version > "
    "   (SELECT ifnull(max(version), 0) FROM refs AS r WHERE r.patient_id = patients.id AND "
    "r.approved_by <> '') ORDER BY version DESC LIMIT 1), note, archived, immobilisation, alert, "
    "has_photo, drawing <> '', sheet_revision FROM patients ";

/// The newest session for fractions of patient ?1 in which a sweep was begun, be it that the power
/// ended it, if it can be resumed: closed since ?2.
constexpr const char* kResumable =
    "SELECT id, fraction, (SELECT count(*) FROM scans WHERE session_id = sessions.id AND outcome = "
    "'done'), closed_at FROM sessions WHERE id = (SELECT max(begun.id) FROM sessions AS begun "
    "WHERE begun.patient_id = ?1 AND begun.purpose = 'fraction' AND EXISTS "
    "(SELECT 1 FROM scans WHERE session_id = begun.id)) AND closed_at >= ?2";

std::int64_t ResumableSince() {
  return StoredNow() - std::int64_t{kResumable_h} * 3600 * 1'000'000;
}

/// "X,Y,B;" for each point, in thousandths of the picture; B is 1 where a line begins.
std::string TextOfDrawing(const std::vector<DrawnPoint>& points) {
  std::string text;
  for (const auto& [x, y, begins] : points)
    text += fmt::format("{},{},{};", std::lround(1000 * x), std::lround(1000 * y), begins ? 1 : 0);
  return text;
}

/// Nothing for what an imported record may hold instead.
std::vector<DrawnPoint> DrawingOf(const std::string& text) {
  std::vector<DrawnPoint> points;
  for (const char* at = text.c_str(); *at != '\0';) {
    int x = 0, y = 0, begins = 0, length = 0;
    if (std::sscanf(at, "%4d,%4d,%1d;%n", &x, &y, &begins, &length) != 3 || length == 0 || x < 0 ||
        x > 1000 || y < 0 || y > 1000 || points.size() == kMaxDrawnPoints)
      return {};
    points.push_back({.x = x / 1000.0, .y = y / 1000.0, .begins = begins == 1});
    at += length;
  }
  return points;
}

Patient ReadPatient(const Statement& row) {
  return {.id = row.Text(0),
          .code = row.Text(1),
          .site = row.Text(2),
          .created_at = FromStored(row.Integer(3)),
          .approved_reference_id = row.Text(4),
          .num_scans = row.Integer(5),
          .draft_reference_id = row.Text(6),
          .note = row.Text(7),
          .immobilisation = row.Text(9),
          .alert = row.Text(10),
          .has_photo = row.Integer(11) != 0,
          .has_drawing = row.Integer(12) != 0,
          .sheet_revision = static_cast<int>(row.Integer(13)),
          .archived = row.Integer(8) != 0};
}

}  // namespace

std::vector<Patient> PatientStore::List() {
  return database_.ForLists()->All(kPatientColumns + "WHERE id > 0 ORDER BY code LIMIT 1000",
                                   ReadPatient);
}

std::optional<Patient> PatientStore::Find(const std::string& id) {
  const StoreDatabase::Held rows = database_.ForRows();
  auto patient = rows->First(kPatientColumns + "WHERE id = ?", ReadPatient, ParseId(id));
  if (patient) {
    patient->last_session = rows->First(
        kResumable,
        [](const Statement& row) {
          return EndedSession{.id = row.Text(0),
                              .fraction = static_cast<int>(row.Integer(1)),
                              .num_scans = static_cast<int>(row.Integer(2)),
                              .closed_at = FromStored(row.Integer(3))};
        },
        ParseId(id), ResumableSince());
  }
  return patient;
}

std::optional<Patient> PatientStore::FindByCode(const std::string& code) {
  return database_.ForRows()->First(kPatientColumns + "WHERE code = ? COLLATE NOCASE AND id > 0",
                                    ReadPatient, code);
}

std::string PatientStore::Add(const Actor& actor, const std::string& code,
                              const std::string& site) {
  StoreChange change(database_);
  // PX-1, px-1 and PX1 would be confused at the couch, and by scanners of wristbands.
  if (const auto same = change->FirstText(
          "SELECT code FROM patients WHERE replace(code, '-', '') = replace(?, '-', '') COLLATE "
          "NOCASE AND id > 0",
          code))
    throw StoreRefusal(ChangeResult::kConflict, say::store::PatientCodeExists(*same));
  try {
    change->Run("INSERT INTO patients (code, site, created_at) VALUES (?, ?, ?)", code, site,
                StoredNow());
  } catch (const ConstraintBroken&) {
    throw StoreRefusal(ChangeResult::kConflict, say::store::PatientExists());
  }
  const std::string id = std::to_string(change->last_id());
  change.Log(actor, "patient.add", id, {});
  change.Commit();
  return id;
}

void PatientStore::Change(const Actor& actor, const std::string& id, const CourseNotes& wanted,
                          const std::optional<CourseNotes>& shown) {
  const std::int64_t number = RequireId(id, "patient");
  StoreChange change(database_);
  const auto stored = change->First(
      "SELECT site, note, immobilisation, alert FROM patients WHERE id = ? AND id > 0",
      [](const Statement& row) {
        return CourseNotes{.site = row.Text(0),
                           .note = row.Text(1),
                           .immobilisation = row.Text(2),
                           .alert = row.Text(3)};
      },
      number);
  if (!stored) throw StoreRefusal(ChangeResult::kNotFound, say::store::NoPatient());
  const auto differs = [](const auto& one, const auto& other) { return one && one != other; };
  if (shown && (shown->site != stored->site || shown->note != stored->note ||
                differs(shown->immobilisation, stored->immobilisation) ||
                differs(shown->alert, stored->alert)))
    throw StoreRefusal(ChangeResult::kConflict, say::store::PatientChanged());
  change->Run(
      "UPDATE patients SET site = ?, note = ?, immobilisation = ?, alert = ? WHERE id = ? AND id > "
      "0",
      wanted.site, wanted.note, wanted.immobilisation.value_or(*stored->immobilisation),
      wanted.alert.value_or(*stored->alert), number);
  // Never the texts themselves: the log keeps its entries when a patient's data is removed.
  const bool has_site = wanted.site != stored->site, has_note = wanted.note != stored->note;
  const bool has_sheet = differs(wanted.immobilisation, stored->immobilisation) ||
                         differs(wanted.alert, stored->alert);
  if (has_sheet) change.Log(actor, "patient.set_up", id, {});
  if (!has_sheet || has_site || has_note)
    change.Log(actor, "patient.change", id,
               has_site && has_note ? say::store::LogSiteAndNote()
               : has_site           ? say::store::LogSite()
               : has_note           ? say::store::LogNote()
                                    : Message());
  change.Commit();
}

std::optional<std::string> PatientStore::Photo(const std::string& id) {
  const std::string stored =
      database_.ForRows()
          ->FirstText("SELECT photo FROM patients WHERE id = ? AND id > 0", ParseId(id))
          .value_or("");
  std::optional<std::string> jpeg = FromBase64(stored);
  // An imported record may hold anything.
  if (!jpeg || !jpeg->starts_with("\xFF\xD8")) return std::nullopt;
  return jpeg;
}

void PatientStore::SetPhoto(const Actor& actor, const std::string& id, const std::string& jpeg) {
  const std::int64_t number = RequireId(id, "patient");
  if (jpeg.size() > kMaxPhoto)
    throw StoreRefusal(ChangeResult::kInvalid, say::store::PhotoTooLarge());
  StoreChange change(database_);
  change->Run(
      "UPDATE patients SET photo = ?, has_photo = ?, drawing = '', sheet_revision = sheet_revision "
      "+ 1 WHERE id = ? AND id > 0",
      ToBase64(jpeg), std::int64_t{jpeg.empty() ? 0 : 1}, number);
  if (change->num_changed() == 0)
    throw StoreRefusal(ChangeResult::kNotFound, say::store::NoPatient());
  change.Log(actor, jpeg.empty() ? "patient.photo_remove" : "patient.photo", id, {});
  change.Commit();
}

std::vector<DrawnPoint> PatientStore::Drawing(const std::string& id) {
  return DrawingOf(
      database_.ForRows()
          ->FirstText("SELECT drawing FROM patients WHERE id = ? AND id > 0", ParseId(id))
          .value_or(""));
}

void PatientStore::SetDrawing(const Actor& actor, const std::string& id,
                              const std::vector<DrawnPoint>& points, int revision) {
  const std::int64_t number = RequireId(id, "patient");
  StoreChange change(database_);
  const auto stored =
      change->FirstInteger("SELECT sheet_revision FROM patients WHERE id = ? AND id > 0", number);
  if (!stored) throw StoreRefusal(ChangeResult::kNotFound, say::store::NoPatient());
  if (*stored != revision) throw StoreRefusal(ChangeResult::kConflict, say::store::SheetChanged());
  change->Run(
      "UPDATE patients SET drawing = ?, sheet_revision = sheet_revision + 1 WHERE id = ? AND id > "
      "0",
      TextOfDrawing(points), number);
  change.Log(actor, points.empty() ? "patient.drawing_remove" : "patient.drawing", id, {});
  change.Commit();
}

void PatientStore::Archive(const Actor& actor, const std::string& id, bool archived) {
  const std::int64_t number = RequireId(id, "patient");
  StoreChange change(database_);
  if (archived &&
      change->Has("SELECT 1 FROM sessions WHERE patient_id = ? AND closed_at IS NULL", number))
    throw StoreRefusal(ChangeResult::kConflict, say::store::SessionOpen());
  change->Run("UPDATE patients SET archived = ? WHERE id = ? AND id > 0", archived, number);
  if (change->num_changed() == 0)
    throw StoreRefusal(ChangeResult::kNotFound, say::store::NoPatient());
  change.Log(actor, archived ? "patient.archive" : "patient.unarchive", id, {});
  change.Commit();
}

namespace {

void CloseOpenSessions(StoreChange& change, const Actor& actor) {
  const std::vector<std::int64_t> open =
      change->All("SELECT id FROM sessions WHERE closed_at IS NULL",
                  [](const Statement& row) { return row.Integer(0); });
  for (const std::int64_t id : open) {
    change->Run("UPDATE sessions SET closed_at = ?, closed_by = ? WHERE id = ?", StoredNow(),
                actor.user, id);
    change.Log(actor, "session.close", std::to_string(id), {});
  }
}

}  // namespace

std::string TreatmentStore::Open(const Actor& actor, const std::string& patient_id,
                                 ScanPurpose purpose) {
  const std::optional<std::int64_t> patient = ParseId(patient_id);
  StoreChange change(database_);
  CloseOpenSessions(change, actor);
  std::int64_t fraction = 0;
  {
    // A fraction is a session in which something was compared. The next number follows the highest
    // one; sessions are not counted, because their scans may have been removed.
    Statement query = change->Prepare(
        "WITH newest AS (SELECT ifnull(max(fraction), 0) AS fraction FROM sessions WHERE "
        "patient_id = ?1 AND purpose = 'fraction') SELECT newest.fraction, archived, EXISTS "
        "(SELECT 1 FROM sessions JOIN scans ON session_id = sessions.id JOIN results ON scan_id = "
        "scans.id WHERE sessions.patient_id = ?1 AND sessions.purpose = 'fraction' AND "
        "sessions.fraction = newest.fraction) FROM patients, newest WHERE patients.id = ?1",
        patient);
    if (!query.Step()) throw StoreRefusal(ChangeResult::kNotFound, say::store::NoPatient());
    if (query.Integer(1) != 0)
      throw StoreRefusal(ChangeResult::kConflict, say::store::PatientArchived());
    if (purpose == ScanPurpose::kFraction)
      fraction = std::max<std::int64_t>(1, query.Integer(0) + query.Integer(2));
  }
  change->Run(
      "INSERT INTO sessions (patient_id, purpose, fraction, opened_at, opened_by, reference_id) "
      "VALUES (?1, ?2, ?3, ?4, ?5, (SELECT id FROM refs WHERE patient_id = ?1 AND ?2 = 'fraction' "
      "AND approved_by <> '' ORDER BY version DESC LIMIT 1))",
      patient, Name(purpose), fraction, StoredNow(), actor.user);
  const std::string id = std::to_string(change->last_id());
  change.Log(actor, "session.open", id, say::store::LogPurpose(Name(purpose)));
  change.Commit();
  return id;
}

void TreatmentStore::CloseAll(const Actor& actor) {
  StoreChange change(database_);
  CloseOpenSessions(change, actor);
  change.Commit();
}

std::optional<std::string> TreatmentStore::PatientOf(const std::string& session_id) {
  const StoreDatabase::Held rows = database_.ForRows();
  RequireRow(*rows, RowKind::kSession, session_id);
  return rows->First(
      "SELECT patient_id FROM sessions WHERE id = ?",
      [](const Statement& row) { return row.Text(0); }, ParseId(session_id));
}

void TreatmentStore::Resume(const Actor& actor, const std::string& session_id) {
  const std::optional<std::int64_t> session = ParseId(session_id);
  StoreChange change(database_);
  const auto patient = change->FirstInteger(
      "SELECT patient_id FROM sessions JOIN patients ON patients.id = patient_id WHERE sessions.id "
      "= ? AND archived = 0",
      session);
  const auto resumable =
      patient ? change->FirstInteger(kResumable, *patient, ResumableSince()) : std::nullopt;
  if (!resumable || resumable != session)
    throw StoreRefusal(ChangeResult::kConflict, say::store::SessionNotResumable(kResumable_h));
  CloseOpenSessions(change, actor);
  change->Run("UPDATE sessions SET closed_at = NULL, closed_by = '', opened_by = ? WHERE id = ?",
              actor.user, session);
  change.Log(actor, "session.resume", session_id, {});
  change.Commit();
}

void TreatmentStore::CorrectFraction(const Actor& actor, const std::string& session_id,
                                     int fraction, const std::string& reason) {
  const std::optional<std::int64_t> session = ParseId(session_id);
  StoreChange change(database_);
  const auto before = change->FirstInteger(
      "SELECT fraction FROM sessions WHERE id = ? AND purpose = 'fraction'", session);
  if (!before) throw StoreRefusal(ChangeResult::kNotFound, say::store::NoSession());
  change->Run("UPDATE sessions SET fraction = ? WHERE id = ?", std::int64_t{fraction}, session);
  change.Log(actor, "session.fraction", session_id,
             say::store::LogFraction(*before, fraction, reason));
  change.Commit();
}

void TreatmentStore::UseReference(const Actor& actor, const std::string& session_id,
                                  const std::string& reference_id) {
  const std::optional<std::int64_t> session = ParseId(session_id),
                                    reference = ParseId(reference_id);
  StoreChange change(database_);
  const auto chosen = change->First(
      "SELECT version, source FROM refs JOIN sessions ON sessions.patient_id = refs.patient_id "
      "WHERE "
      "refs.id = ?2 AND sessions.id = ?1 AND closed_at IS NULL AND purpose = 'fraction' AND "
      "approved_by <> '' AND NOT EXISTS (SELECT 1 FROM refs AS newer WHERE newer.patient_id = "
      "refs.patient_id AND newer.source = refs.source AND newer.approved_by <> '' AND "
      "newer.version > refs.version)",
      [](const Statement& row) { return std::pair(row.Integer(0), row.Text(1)); }, session,
      reference);
  if (!chosen) throw StoreRefusal(ChangeResult::kConflict, say::store::ReferenceNotForSession());
  change->Run(
      "UPDATE sessions SET reference_id = ?1, chosen_at_version = (SELECT max(version) FROM refs "
      "WHERE refs.patient_id = sessions.patient_id AND approved_by <> '') WHERE id = ?2",
      reference, session);
  change.Log(actor, "session.reference", session_id,
             say::store::LogVersion(chosen->first, chosen->second));
  change.Commit();
}

std::optional<TreatmentSession> TreatmentStore::Opened() {
  const StoreDatabase::Held rows = database_.ForRows();
  std::optional<TreatmentSession> opened = rows->First(
      "WITH open AS (SELECT sessions.*, (SELECT id FROM refs WHERE refs.patient_id = "
      "sessions.patient_id AND approved_by <> '' ORDER BY version DESC LIMIT 1) AS newest_id FROM "
      "sessions WHERE closed_at IS NULL ORDER BY id DESC LIMIT 1) "
      "SELECT open.id, open.patient_id, code, purpose, fraction, opened_by, opened_at, (SELECT "
      "count(*) FROM scans WHERE session_id = open.id AND outcome = 'done'), kept.id, "
      "kept.version, newest.id, newest.version, ifnull((SELECT accepted_by = '' AND "
      "results.scan_id IS NOT NULL FROM scans LEFT JOIN results ON scan_id = scans.id WHERE "
      "session_id = open.id AND outcome = 'done' ORDER BY scans.id DESC LIMIT 1), 0), "
      "ifnull((SELECT "
      "language FROM preferences WHERE user = opened_by), ''), kept.source, newest.source, "
      "other.id, "
      "other.version, other.source, newest.version > chosen_at_version, ifnull((SELECT hint FROM "
      "templates WHERE templates.site = patients.site), ''), kept.created_at FROM open "
      "JOIN patients ON patients.id = "
      "open.patient_id LEFT JOIN refs AS kept ON kept.id = ifnull(reference_id, newest_id) LEFT "
      "JOIN refs AS newest ON newest.id = newest_id LEFT JOIN refs AS other ON other.id = (SELECT "
      "id FROM refs WHERE refs.patient_id = open.patient_id AND approved_by <> '' AND source <> "
      "kept.source ORDER BY version DESC LIMIT 1)",
      [](const Statement& row) {
        TreatmentSession session{.id = row.Text(0),
                                 .patient_id = row.Text(1),
                                 .patient_code = row.Text(2),
                                 .purpose = ParseStored<ScanPurpose>("purpose", row.Text(3)),
                                 .fraction = static_cast<int>(row.Integer(4)),
                                 .num_scans = static_cast<int>(row.Integer(7)),
                                 .opened_by = row.Text(5),
                                 .opened_at = FromStored(row.Integer(6)),
                                 .has_unaccepted = row.Integer(12) != 0};
        const auto version = [&](int column, int source) {
          return ReferenceVersion{
              .id = row.Text(column),
              .version = static_cast<int>(row.Integer(column + 1)),
              .source = ParseStored<ReferenceSource>("source", row.Text(source))};
        };
        session.language = row.Text(13);
        session.sweep_hint = row.Text(20);
        if (!row.IsNull(8)) {
          session.reference = version(8, 14);
          session.reference_created_at = FromStored(row.Integer(21));
        }
        if (session.reference && row.Text(10) != session.reference->id && row.Integer(19) != 0)
          session.newer_reference = version(10, 15);
        if (!row.IsNull(16)) session.other_reference = version(16, 18);
        return session;
      });
  if (opened) RequireRow(*rows, RowKind::kSession, opened->id);
  return opened;
}

}  // namespace plumb
