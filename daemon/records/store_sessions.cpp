// Treatment sessions, and the screens in the room.
#include "daemon/records/store.hpp"
#include "daemon/records/store_internal.hpp"

namespace plumb {

using store::FromStored;
using store::ParseId;
using store::ToStored;
using web::ChangeResult;

void Store::CloseOpenSessions(const web::Actor& actor) {
  std::vector<std::string> open;
  {
    Statement query = write_->Prepare("SELECT id FROM sessions WHERE closed_at IS NULL");
    while (query.Step()) open.push_back(query.Text(0));
  }
  for (const std::string& id : open) {
    write_->Prepare("UPDATE sessions SET closed_at = ?, closed_by = ? WHERE id = ?")
        .Bind(ToStored(web::WallClock::now()))
        .Bind(actor.user)
        .Bind(ParseId(id))
        .Run();
    Write(actor, "session.close", id, "");
  }
}

std::string Store::OpenSession(const web::Actor& actor, const std::string& patient_id,
                               web::ScanPurpose purpose) {
  const std::optional<std::int64_t> patient = ParseId(patient_id);
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  CloseOpenSessions(actor);
  std::int64_t fraction = 0;
  {
    // Fractions are counted by sessions in which something was compared, not by scans.
    Statement query = write_->Prepare(
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
  write_
      ->Prepare(
          "INSERT INTO sessions (patient_id, purpose, fraction, opened_at, opened_by) VALUES (?, "
          "?, ?, ?, ?)")
      .Bind(*patient)
      .Bind(store::Name(purpose))
      .Bind(fraction)
      .Bind(ToStored(web::WallClock::now()))
      .Bind(actor.user)
      .Run();
  const std::string id = std::to_string(write_->last_id());
  Write(actor, "session.open", id, "patient " + patient_id + ", " + store::Name(purpose));
  transaction.Commit();
  return id;
}

void Store::CloseSessions(const web::Actor& actor) {
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  CloseOpenSessions(actor);
  transaction.Commit();
}

std::optional<web::TreatmentSession> Store::OpenedSession() {
  const std::lock_guard lock(read_mutex_);
  Statement query = read_->Prepare(
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

std::vector<web::WaitingReference> Store::WaitingReferences() {
  const std::lock_guard lock(read_mutex_);
  Statement query = read_->Prepare(
      "SELECT refs.id, patient_id, code, version FROM refs JOIN patients ON patients.id = "
      "patient_id WHERE archived = 0 AND approved_by = '' AND version > (SELECT "
      "ifnull(max(version), 0) FROM refs "
      "AS r WHERE r.patient_id = refs.patient_id AND r.approved_by <> '') AND NOT EXISTS (SELECT 1 "
      "FROM refs AS newer WHERE newer.patient_id = refs.patient_id AND newer.version > "
      "refs.version) ORDER BY refs.id DESC LIMIT 20");
  std::vector<web::WaitingReference> waiting;
  while (query.Step()) {
    waiting.push_back({.reference_id = query.Text(0),
                       .patient_id = query.Text(1),
                       .patient_code = query.Text(2),
                       .version = static_cast<int>(query.Integer(3))});
  }
  return waiting;
}

std::vector<web::Display> Store::Displays() {
  const std::lock_guard lock(read_mutex_);
  Statement query = read_->Prepare(
      "SELECT id, name, token_hash, paired_at, paired_by FROM displays ORDER BY id LIMIT 100");
  std::vector<web::Display> displays;
  while (query.Step()) {
    displays.push_back({.id = query.Text(0),
                        .name = query.Text(1),
                        .token_hash = query.Text(2),
                        .paired_at = FromStored(query.Integer(3)),
                        .paired_by = query.Text(4)});
  }
  return displays;
}

std::string Store::AddDisplay(const web::Actor& actor, const web::Display& display) {
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  write_
      ->Prepare("INSERT INTO displays (name, token_hash, paired_at, paired_by) VALUES (?, ?, ?, ?)")
      .Bind(display.name)
      .Bind(display.token_hash)
      .Bind(ToStored(web::WallClock::now()))
      .Bind(actor.user)
      .Run();
  const std::string id = std::to_string(write_->last_id());
  Write(actor, "display.pair", id, display.name);
  transaction.Commit();
  return id;
}

void Store::RemoveDisplay(const web::Actor& actor, const std::string& id) {
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  write_->Prepare("DELETE FROM displays WHERE id = ?").Bind(ParseId(id)).Run();
  if (write_->num_changed() == 0)
    throw StoreRefusal(ChangeResult::kNotFound, "there is no such display");
  Write(actor, "display.remove", id, "");
  transaction.Commit();
}

}  // namespace plumb
