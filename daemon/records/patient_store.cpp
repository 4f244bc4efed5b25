#include "daemon/records/patient_store.hpp"

#include <fmt/format.h>

#include "daemon/records/store_refusal.hpp"
#include "daemon/records/stored_values.hpp"

namespace plumb {

using store::FromStored;
using store::Now;
using store::ParseId;
using store::RequireId;
using web::ChangeResult;

namespace {

constexpr const char* kPatientColumns =
    "SELECT id, code, site, created_at,"
    " (SELECT max(refs.id) FROM refs WHERE refs.patient_id = patients.id AND approved_by <> '' AND "
    "version ="
    "   (SELECT max(version) FROM refs AS r WHERE r.patient_id = patients.id AND r.approved_by <> "
    "'')),"
    " (SELECT count(*) FROM scans WHERE scans.patient_id = patients.id AND outcome = 'done'),"
    " (SELECT id FROM refs WHERE refs.patient_id = patients.id AND approved_by = '' AND version > "
    "   (SELECT ifnull(max(version), 0) FROM refs AS r WHERE r.patient_id = patients.id AND "
    "r.approved_by <> '') ORDER BY version DESC LIMIT 1), note, archived FROM patients ";

web::Patient ReadPatient(const Statement& row) {
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

std::vector<web::Patient> PatientStore::List() {
  const StoreDatabase::Held lists = database_.ForLists();
  static const std::string kSql =
      std::string(kPatientColumns) + "WHERE id > 0 ORDER BY code LIMIT 1000";
  Statement query = lists->Prepare(kSql.c_str());
  std::vector<web::Patient> patients;
  while (query.Step()) patients.push_back(ReadPatient(query));
  return patients;
}

std::optional<web::Patient> PatientStore::Find(const std::string& id) {
  const std::optional<std::int64_t> number = ParseId(id);
  if (!number) return std::nullopt;
  const StoreDatabase::Held rows = database_.ForRows();
  static const std::string kSql = std::string(kPatientColumns) + "WHERE id = ?";
  Statement query = rows->Prepare(kSql.c_str());
  return query.Bind(*number).Step() ? std::optional(ReadPatient(query)) : std::nullopt;
}

std::optional<web::Patient> PatientStore::FindByCode(const std::string& code) {
  const StoreDatabase::Held rows = database_.ForRows();
  static const std::string kSql =
      std::string(kPatientColumns) + "WHERE code = ? COLLATE NOCASE AND id > 0";
  Statement query = rows->Prepare(kSql.c_str());
  return query.Bind(code).Step() ? std::optional(ReadPatient(query)) : std::nullopt;
}

std::string PatientStore::Add(const web::Actor& actor, const std::string& code,
                              const std::string& site) {
  StoreChange change(database_);
  {  // PX-1 and px-1 would be confused at the couch
    Statement query = change.Prepare("SELECT code FROM patients WHERE code = ? COLLATE NOCASE");
    if (query.Bind(code).Step())
      throw StoreRefusal(ChangeResult::kConflict,
                         fmt::format("there is a patient with the code {} already: choose another "
                                     "code (capital and small letters count as the same)",
                                     query.Text(0)));
  }
  try {
    change.Prepare("INSERT INTO patients (code, site, created_at) VALUES (?, ?, ?)")
        .Bind(code)
        .Bind(site)
        .Bind(Now())
        .Run();
  } catch (const ConstraintBroken&) {
    throw StoreRefusal(ChangeResult::kConflict,
                       "there is a patient with this code already: choose another code");
  }
  const std::string id = std::to_string(change.last_id());
  change.Log(actor, "patient.add", id, "");
  change.Commit();
  return id;
}

void PatientStore::Change(const web::Actor& actor, const std::string& id, const std::string& site,
                          const std::string& note, const std::optional<web::CourseNotes>& shown) {
  const std::int64_t number = RequireId(id, "patient");
  StoreChange change(database_);
  web::CourseNotes before;
  {
    Statement query = change.Prepare("SELECT site, note FROM patients WHERE id = ? AND id > 0");
    const bool exists = query.Bind(number).Step();
    if (exists) before = {.site = query.Text(0), .note = query.Text(1)};
    if (shown && exists && *shown != before)
      throw StoreRefusal(ChangeResult::kConflict,
                         "this patient was changed by somebody else meanwhile: look again, then "
                         "save");
  }
  change.Prepare("UPDATE patients SET site = ?, note = ? WHERE id = ? AND id > 0")
      .Bind(site)
      .Bind(note)
      .Bind(number)
      .Run();
  if (change.num_changed() == 0)
    throw StoreRefusal(ChangeResult::kNotFound, "there is no such patient");
  // Never the texts themselves: the log keeps its entries when a patient's data is removed.
  const bool has_site = site != before.site, has_note = note != before.note;
  change.Log(actor, "patient.change", id,
             has_site && has_note ? "site and note"
             : has_site           ? "site"
             : has_note           ? "note"
                                  : "");
  change.Commit();
}

void PatientStore::Archive(const web::Actor& actor, const std::string& id, bool archived) {
  const std::int64_t number = RequireId(id, "patient");
  StoreChange change(database_);
  {
    Statement query =
        change.Prepare("SELECT 1 FROM sessions WHERE patient_id = ? AND closed_at IS NULL");
    if (archived && query.Bind(number).Step())
      throw StoreRefusal(ChangeResult::kConflict,
                         "the session of this patient is open: close it first");
  }
  change.Prepare("UPDATE patients SET archived = ? WHERE id = ? AND id > 0")
      .Bind(std::int64_t{archived})
      .Bind(number)
      .Run();
  if (change.num_changed() == 0)
    throw StoreRefusal(ChangeResult::kNotFound, "there is no such patient");
  change.Log(actor, archived ? "patient.archive" : "patient.unarchive", id, "");
  change.Commit();
}

}  // namespace plumb
