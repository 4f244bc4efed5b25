#include "daemon/records/treatment_store.hpp"

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
    // Fractions are counted by sessions in which something was compared, not by scans.
    Statement query = change.Prepare(
        "SELECT (SELECT count(*) FROM sessions WHERE patient_id = patients.id AND purpose = "
        "'fraction' AND EXISTS (SELECT 1 FROM scans JOIN results ON scan_id = scans.id WHERE "
        "session_id = sessions.id)), archived FROM patients WHERE id = ?");
    if (!patient || !query.Bind(*patient).Step())
      throw StoreRefusal(ChangeResult::kNotFound, "there is no such patient");
    if (query.Integer(1) != 0)
      throw StoreRefusal(ChangeResult::kConflict,
                         "this patient is archived: take it out of the archive first");
    if (purpose == web::ScanPurpose::kFraction) fraction = 1 + query.Integer(0);
  }
  change
      .Prepare(
          "INSERT INTO sessions (patient_id, purpose, fraction, opened_at, opened_by) VALUES (?, "
          "?, ?, ?, ?)")
      .Bind(*patient)
      .Bind(store::Name(purpose))
      .Bind(fraction)
      .Bind(Now())
      .Bind(actor.user)
      .Run();
  const std::string id = std::to_string(change.last_id());
  change.Log(actor, "session.open", id, store::Name(purpose));
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
                               .purpose = store::ParsePurpose(query.Text(3)),
                               .fraction = static_cast<int>(query.Integer(4)),
                               .num_scans = static_cast<int>(query.Integer(7)),
                               .opened_by = query.Text(5),
                               .opened_at = FromStored(query.Integer(6))};
}

}  // namespace plumb
