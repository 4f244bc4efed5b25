#include "daemon/records/treatment_store.hpp"

#include <algorithm>

#include "daemon/records/store_refusal.hpp"
#include "daemon/records/stored_values.hpp"

namespace plumb {

using store::FromStored;
using store::Now;
using store::ParseId;
using web::ChangeResult;

namespace {

void CloseOpenSessions(StoreChange& change, const web::Actor& actor) {
  std::vector<std::string> open;
  {
    Statement query = change.Prepare("SELECT id FROM sessions WHERE closed_at IS NULL");
    while (query.Step()) open.push_back(query.Text(0));
  }
  for (const std::string& id : open) {
    change.Prepare("UPDATE sessions SET closed_at = ?, closed_by = ? WHERE id = ?")
        .Bind(Now())
        .Bind(actor.user)
        .Bind(ParseId(id))
        .Run();
    change.Log(actor, "session.close", id, "");
  }
}

}  // namespace

std::string TreatmentStore::Open(const web::Actor& actor, const std::string& patient_id,
                                 web::ScanPurpose purpose) {
  const std::optional<std::int64_t> patient = ParseId(patient_id);
  StoreChange change(database_);
  CloseOpenSessions(change, actor);
  std::int64_t fraction = 0;
  {
    // A fraction is a session in which something was compared. The next number follows the highest
    // one; sessions are not counted, because their scans may have been removed.
    Statement query = change.Prepare(
        "WITH newest AS (SELECT ifnull(max(fraction), 0) AS fraction FROM sessions WHERE "
        "patient_id = ?1 AND purpose = 'fraction') SELECT newest.fraction, archived, EXISTS "
        "(SELECT 1 FROM sessions JOIN scans ON session_id = sessions.id JOIN results ON scan_id = "
        "scans.id WHERE sessions.patient_id = ?1 AND sessions.purpose = 'fraction' AND "
        "sessions.fraction = newest.fraction) FROM patients, newest WHERE patients.id = ?1");
    if (!patient || !query.Bind(*patient).Step())
      throw StoreRefusal(ChangeResult::kNotFound, "there is no such patient");
    if (query.Integer(1) != 0)
      throw StoreRefusal(ChangeResult::kConflict,
                         "this patient is archived: take it out of the archive first");
    if (purpose == web::ScanPurpose::kFraction)
      fraction = std::max<std::int64_t>(1, query.Integer(0) + query.Integer(2));
  }
  change
      .Prepare(
          "INSERT INTO sessions (patient_id, purpose, fraction, opened_at, opened_by) VALUES (?, "
          "?, ?, ?, ?)")
      .Bind(*patient)
      .Bind(Name(purpose))
      .Bind(fraction)
      .Bind(Now())
      .Bind(actor.user)
      .Run();
  const std::string id = std::to_string(change.last_id());
  change.Log(actor, "session.open", id, std::string(Name(purpose)));
  change.Commit();
  return id;
}

void TreatmentStore::CloseAll(const web::Actor& actor) {
  StoreChange change(database_);
  CloseOpenSessions(change, actor);
  change.Commit();
}

std::optional<web::TreatmentSession> TreatmentStore::Opened() {
  const StoreDatabase::Held rows = database_.ForRows();
  Statement query = rows->Prepare(
      "SELECT sessions.id, patient_id, code, purpose, fraction, opened_by, opened_at, (SELECT "
      "count(*) FROM scans WHERE session_id = sessions.id AND outcome = 'done') FROM sessions JOIN "
      "patients ON patients.id = patient_id WHERE closed_at IS NULL ORDER BY sessions.id DESC "
      "LIMIT 1");
  if (!query.Step()) return std::nullopt;
  return web::TreatmentSession{.id = query.Text(0),
                               .patient_id = query.Text(1),
                               .patient_code = query.Text(2),
                               .purpose = store::Parse<web::ScanPurpose>("purpose", query.Text(3)),
                               .fraction = static_cast<int>(query.Integer(4)),
                               .num_scans = static_cast<int>(query.Integer(7)),
                               .opened_by = query.Text(5),
                               .opened_at = FromStored(query.Integer(6))};
}

}  // namespace plumb
