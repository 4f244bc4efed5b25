#include "daemon/records/patient_store.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "daemon/records/store_refusal.hpp"
#include "daemon/records/stored_values.hpp"

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
    "r.approved_by <> '') ORDER BY version DESC LIMIT 1), note, archived FROM patients ";

Patient ReadPatient(const Statement& row) {
  return {.id = row.Text(0),
          .code = row.Text(1),
          .site = row.Text(2),
          .created_at = FromStored(row.Integer(3)),
          .approved_reference_id = row.Text(4),
          .num_scans = row.Integer(5),
          .draft_reference_id = row.Text(6),
          .note = row.Text(7),
          .archived = row.Integer(8) != 0};
}

}  // namespace

std::vector<Patient> PatientStore::List() {
  return database_.ForLists()->All(kPatientColumns + "WHERE id > 0 ORDER BY code LIMIT 1000",
                                   ReadPatient);
}

std::optional<Patient> PatientStore::Find(const std::string& id) {
  return database_.ForRows()->First(kPatientColumns + "WHERE id = ?", ReadPatient, ParseId(id));
}

std::optional<Patient> PatientStore::FindByCode(const std::string& code) {
  return database_.ForRows()->First(kPatientColumns + "WHERE code = ? COLLATE NOCASE AND id > 0",
                                    ReadPatient, code);
}

std::string PatientStore::Add(const Actor& actor, const std::string& code,
                              const std::string& site) {
  StoreChange change(database_);
  // PX-1 and px-1 would be confused at the couch.
  if (const auto same =
          change->FirstText("SELECT code FROM patients WHERE code = ? COLLATE NOCASE", code))
    throw StoreRefusal(ChangeResult::kConflict,
                       fmt::format("there is a patient with the code {} already: choose another "
                                   "code (capital and small letters count as the same)",
                                   *same));
  try {
    change->Run("INSERT INTO patients (code, site, created_at) VALUES (?, ?, ?)", code, site,
                StoredNow());
  } catch (const ConstraintBroken&) {
    throw StoreRefusal(ChangeResult::kConflict,
                       "there is a patient with this code already: choose another code");
  }
  const std::string id = std::to_string(change->last_id());
  change.Log(actor, "patient.add", id, "");
  change.Commit();
  return id;
}

void PatientStore::Change(const Actor& actor, const std::string& id, const std::string& site,
                          const std::string& note, const std::optional<CourseNotes>& shown) {
  const std::int64_t number = RequireId(id, "patient");
  StoreChange change(database_);
  const auto stored = change->First(
      "SELECT site, note FROM patients WHERE id = ? AND id > 0",
      [](const Statement& row) { return CourseNotes{.site = row.Text(0), .note = row.Text(1)}; },
      number);
  if (!stored) throw StoreRefusal(ChangeResult::kNotFound, "there is no such patient");
  if (shown && *shown != *stored)
    throw StoreRefusal(ChangeResult::kConflict,
                       "this patient was changed by somebody else meanwhile: look again, then "
                       "save");
  change->Run("UPDATE patients SET site = ?, note = ? WHERE id = ? AND id > 0", site, note, number);
  // Never the texts themselves: the log keeps its entries when a patient's data is removed.
  const bool has_site = site != stored->site, has_note = note != stored->note;
  change.Log(actor, "patient.change", id,
             has_site && has_note ? "site and note"
             : has_site           ? "site"
             : has_note           ? "note"
                                  : "");
  change.Commit();
}

void PatientStore::Archive(const Actor& actor, const std::string& id, bool archived) {
  const std::int64_t number = RequireId(id, "patient");
  StoreChange change(database_);
  if (archived &&
      change->Has("SELECT 1 FROM sessions WHERE patient_id = ? AND closed_at IS NULL", number))
    throw StoreRefusal(ChangeResult::kConflict,
                       "the session of this patient is open: close it first");
  change->Run("UPDATE patients SET archived = ? WHERE id = ? AND id > 0", archived, number);
  if (change->num_changed() == 0)
    throw StoreRefusal(ChangeResult::kNotFound, "there is no such patient");
  change.Log(actor, archived ? "patient.archive" : "patient.unarchive", id, "");
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
    change.Log(actor, "session.close", std::to_string(id), "");
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
    if (!query.Step()) throw StoreRefusal(ChangeResult::kNotFound, "there is no such patient");
    if (query.Integer(1) != 0)
      throw StoreRefusal(ChangeResult::kConflict,
                         "this patient is archived: take it out of the archive first");
    if (purpose == ScanPurpose::kFraction)
      fraction = std::max<std::int64_t>(1, query.Integer(0) + query.Integer(2));
  }
  change->Run(
      "INSERT INTO sessions (patient_id, purpose, fraction, opened_at, opened_by) VALUES (?, "
      "?, ?, ?, ?)",
      patient, Name(purpose), fraction, StoredNow(), actor.user);
  const std::string id = std::to_string(change->last_id());
  change.Log(actor, "session.open", id, std::string(Name(purpose)));
  change.Commit();
  return id;
}

void TreatmentStore::CloseAll(const Actor& actor) {
  StoreChange change(database_);
  CloseOpenSessions(change, actor);
  change.Commit();
}

std::optional<TreatmentSession> TreatmentStore::Opened() {
  return database_.ForRows()->First(
      "SELECT sessions.id, patient_id, code, purpose, fraction, opened_by, opened_at, (SELECT "
      "count(*) FROM scans WHERE session_id = sessions.id AND outcome = 'done') FROM sessions JOIN "
      "patients ON patients.id = patient_id WHERE closed_at IS NULL ORDER BY sessions.id DESC "
      "LIMIT 1",
      [](const Statement& row) {
        return TreatmentSession{.id = row.Text(0),
                                .patient_id = row.Text(1),
                                .patient_code = row.Text(2),
                                .purpose = ParseStored<ScanPurpose>("purpose", row.Text(3)),
                                .fraction = static_cast<int>(row.Integer(4)),
                                .num_scans = static_cast<int>(row.Integer(7)),
                                .opened_by = row.Text(5),
                                .opened_at = FromStored(row.Integer(6))};
      });
}

}  // namespace plumb
