#include "daemon/records/store.hpp"

#include <array>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "daemon/records/schema.hpp"
#include "daemon/records/store_internal.hpp"
#include "daemon/records/store_json.hpp"
#include "web/service/names.hpp"

namespace plumb {

using store::FromStored;
using store::ParseId;
using store::ScanId;
using store::ToStored;
using web::ChangeResult;

namespace store {

std::string ScanId(std::int64_t id) { return fmt::format("{:06}", id); }

const char* Name(web::ScanPurpose purpose) {
  return web::kPurposeNames.at(static_cast<std::size_t>(purpose)).data();
}
const char* Name(web::ScanOutcome outcome) {
  return web::kOutcomeNames.at(static_cast<std::size_t>(outcome)).data();
}
const char* Name(web::Role role) {
  return web::kRoleNames.at(static_cast<std::size_t>(role)).data();
}

namespace {

/// The value of that name. @throws DataError where there is none.
template <typename Value, std::size_t kSize>
Value Parse(const char* what, std::string_view name,
            const std::array<std::string_view, kSize>& names) {
  for (std::size_t i = 0; i < kSize; ++i) {
    if (name == names[i]) return static_cast<Value>(i);
  }
  throw DataError(
      fmt::format("the stored {} '{}' is none that this version knows: the database was changed "
                  "from outside, or its disk failed. Put a backup of it in its place",
                  what, name.substr(0, 32)));
}

}  // namespace

web::ScanPurpose ParsePurpose(std::string_view name) {
  return Parse<web::ScanPurpose>("purpose", name, web::kPurposeNames);
}
web::ScanOutcome ParseOutcome(std::string_view name) {
  return Parse<web::ScanOutcome>("outcome", name, web::kOutcomeNames);
}
web::Role ParseRole(std::string_view name) {
  return Parse<web::Role>("role", name, web::kRoleNames);
}

}  // namespace store

namespace {

std::int64_t Now() { return ToStored(web::WallClock::now()); }

std::int64_t RequireId(const std::string& text, const char* what) {
  if (const std::optional<std::int64_t> id = ParseId(text)) return *id;
  throw StoreRefusal(ChangeResult::kNotFound,
                     fmt::format("there is no {} '{}'", what, text.substr(0, 32)));
}

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

/// SHA-256 of what an approval signs.
std::string DigestOf(const std::string& patient_id, int version, const std::string& scan_id,
                     const std::string& plan_json) {
  const std::string text =
      fmt::format("patient {}\nversion {}\nscan {}\n{}", patient_id, version, scan_id, plan_json);
  Sha256 hash;
  hash.Add(text.data(), text.size());
  return hash.Hex();
}

/// @throws DataError naming the version whose plan cannot be read: nothing is compared with it.
web::ReferencePlan PlanIn(const Statement& row) {
  try {
    return ParsePlan(row.Text(9));
  } catch (const DataError& error) {
    throw DataError(fmt::format("version {} of the reference: {}", row.Integer(2), error.what()));
  }
}

/// Without its plan.
web::Reference ReadReferenceRow(const Statement& row) {
  web::Reference reference{.id = row.Text(0),
                           .patient_id = row.Text(1),
                           .version = static_cast<int>(row.Integer(2)),
                           .scan_id = ScanId(row.Integer(3)),
                           .created_at = FromStored(row.Integer(4)),
                           .created_by = row.Text(5),
                           .reason = row.Text(6),
                           .revision = static_cast<int>(row.Integer(10)),
                           .digest = {},
                           .planned_by = row.Text(11),
                           .approved_by = row.Text(7),
                           .approved_at = {},
                           .plan = {}};
  if (!row.IsNull(8)) reference.approved_at = FromStored(row.Integer(8));
  reference.digest = DigestOf(row.Text(1), reference.version, reference.scan_id, row.Text(9));
  return reference;
}

/// @throws DataError where the plan cannot be read: it is never a default.
web::Reference ReadReference(const Statement& row) {
  web::Reference reference = ReadReferenceRow(row);
  reference.plan = PlanIn(row);
  return reference;
}

/// For lists: one that cannot be read does not hide the others.
web::Reference ListReference(const Statement& row) {
  web::Reference reference = ReadReferenceRow(row);
  try {
    reference.plan = PlanIn(row);
  } catch (const DataError& error) {
    reference.unreadable = error.what();
  }
  return reference;
}

}  // namespace

std::vector<web::Patient> Store::Patients() {
  const std::lock_guard lock(list_mutex_);
  static const std::string kSql =
      std::string(kPatientColumns) + "WHERE id > 0 ORDER BY code LIMIT 1000";
  Statement query = list_->Prepare(kSql.c_str());
  std::vector<web::Patient> patients;
  while (query.Step()) patients.push_back(ReadPatient(query));
  return patients;
}

std::optional<web::Patient> Store::FindPatient(const std::string& id) {
  const std::optional<std::int64_t> number = ParseId(id);
  if (!number) return std::nullopt;
  const std::lock_guard lock(read_mutex_);
  static const std::string kSql = std::string(kPatientColumns) + "WHERE id = ?";
  Statement query = read_->Prepare(kSql.c_str());
  return query.Bind(*number).Step() ? std::optional(ReadPatient(query)) : std::nullopt;
}

std::optional<web::Patient> Store::FindPatientByCode(const std::string& code) {
  const std::lock_guard lock(read_mutex_);
  static const std::string kSql =
      std::string(kPatientColumns) + "WHERE code = ? COLLATE NOCASE AND id > 0";
  Statement query = read_->Prepare(kSql.c_str());
  return query.Bind(code).Step() ? std::optional(ReadPatient(query)) : std::nullopt;
}

std::string Store::AddPatient(const web::Actor& actor, const std::string& code,
                              const std::string& site) {
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  {  // nobody tells PX-1 and px-1 apart at the couch
    Statement query = write_->Prepare("SELECT code FROM patients WHERE code = ? COLLATE NOCASE");
    if (query.Bind(code).Step())
      throw StoreRefusal(ChangeResult::kConflict,
                         fmt::format("there is a patient with the code {} already: choose another "
                                     "code (capital and small letters count as the same)",
                                     query.Text(0)));
  }
  try {
    write_->Prepare("INSERT INTO patients (code, site, created_at) VALUES (?, ?, ?)")
        .Bind(code)
        .Bind(site)
        .Bind(Now())
        .Run();
  } catch (const ConstraintBroken&) {
    throw StoreRefusal(ChangeResult::kConflict,
                       "there is a patient with this code already: choose another code");
  }
  const std::string id = std::to_string(write_->last_id());
  Write(actor, "patient.add", id, "");
  transaction.Commit();
  return id;
}

void Store::ChangePatient(const web::Actor& actor, const std::string& id, const std::string& site,
                          const std::string& note) {
  const std::int64_t number = RequireId(id, "patient");
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  write_->Prepare("UPDATE patients SET site = ?, note = ? WHERE id = ? AND id > 0")
      .Bind(site)
      .Bind(note)
      .Bind(number)
      .Run();
  if (write_->num_changed() == 0)
    throw StoreRefusal(ChangeResult::kNotFound, "there is no such patient");
  Write(actor, "patient.change", id, "site and note");  // never their text
  transaction.Commit();
}

void Store::ArchivePatient(const web::Actor& actor, const std::string& id, bool archived) {
  const std::int64_t number = RequireId(id, "patient");
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  {
    Statement query =
        write_->Prepare("SELECT 1 FROM sessions WHERE patient_id = ? AND closed_at IS NULL");
    if (archived && query.Bind(number).Step())
      throw StoreRefusal(ChangeResult::kConflict,
                         "the session of this patient is open: close it first");
  }
  write_->Prepare("UPDATE patients SET archived = ? WHERE id = ? AND id > 0")
      .Bind(std::int64_t{archived})
      .Bind(number)
      .Run();
  if (write_->num_changed() == 0)
    throw StoreRefusal(ChangeResult::kNotFound, "there is no such patient");
  Write(actor, archived ? "patient.archive" : "patient.unarchive", id, "");
  transaction.Commit();
}

void Store::WipePatient(const web::Actor& actor, const std::string& id) {
  const std::int64_t number = RequireId(id, "patient");
  std::vector<std::string> scans;
  const std::unique_lock removals = LockRemovals();
  {
    const std::lock_guard lock(write_mutex_);
    Transaction transaction(*write_);
    {
      Statement query = write_->Prepare("SELECT id FROM scans WHERE patient_id = ?");
      query.Bind(number);
      scans = ScansOf(std::move(query));
    }
    if (running_) {
      Statement running = write_->Prepare("SELECT 1 FROM scans WHERE patient_id = ? AND id = ?");
      if (running.Bind(number).Bind(*running_).Step())
        throw StoreRefusal(ChangeResult::kConflict,
                           "a scan of this patient is running: end or cancel it first");
    }
    write_->Prepare("UPDATE patients SET wiping = 1 WHERE id = ?").Bind(number).Run();
    if (write_->num_changed() == 0)
      throw StoreRefusal(ChangeResult::kNotFound, "there is no such patient");
    for (const std::string& scan : scans) NoteRemoved(scan);
    write_->Prepare("DELETE FROM refs WHERE patient_id = ?").Bind(number).Run();
    write_->Prepare("DELETE FROM patients WHERE id = ?").Bind(number).Run();
    Write(actor, "patient.wipe", id, fmt::format("{} scans", scans.size()));
    transaction.Commit();
  }
  for (const std::string& scan : scans)
    RemoveScanFiles(scan);  // what a crash leaves here goes at the next start
  std::error_code ignored;
  std::filesystem::remove(folder_ / "imports" / (std::to_string(number) + ".json"), ignored);
  const std::lock_guard lock(write_mutex_);
  write_->Prepare("PRAGMA wal_checkpoint(TRUNCATE)").Run();  // nor does the log keep what was wiped
}

namespace {

constexpr const char* kReferenceColumns =
    "SELECT id, patient_id, version, scan_id, created_at, created_by, reason, approved_by, "
    "approved_at, plan, revision, planned_by FROM refs ";

}  // namespace

std::vector<web::Reference> Store::References(const std::string& patient_id) {
  std::vector<web::Reference> references;
  const std::optional<std::int64_t> number = ParseId(patient_id);
  if (!number) return references;
  const std::lock_guard lock(list_mutex_);
  static const std::string kSql =
      std::string(kReferenceColumns) + "WHERE patient_id = ? ORDER BY version DESC LIMIT 1000";
  Statement query = list_->Prepare(kSql.c_str());
  query.Bind(*number);
  while (query.Step()) references.push_back(ListReference(query));
  return references;
}

std::optional<web::Reference> Store::FindReference(const std::string& id) {
  const std::optional<std::int64_t> number = ParseId(id);
  if (!number) return std::nullopt;
  const std::lock_guard lock(read_mutex_);
  static const std::string kSql = std::string(kReferenceColumns) + "WHERE id = ?";
  Statement query = read_->Prepare(kSql.c_str());
  return query.Bind(*number).Step() ? std::optional(ReadReference(query)) : std::nullopt;
}

std::optional<web::Reference> Store::ApprovedReference(const std::string& patient_id) {
  const std::optional<std::int64_t> number = ParseId(patient_id);
  if (!number) return std::nullopt;
  const std::lock_guard lock(read_mutex_);
  static const std::string kSql =
      std::string(kReferenceColumns) +
      "WHERE patient_id = ? AND approved_by <> '' ORDER BY version DESC LIMIT 1";
  Statement query = read_->Prepare(kSql.c_str());
  return query.Bind(*number).Step() ? std::optional(ReadReference(query)) : std::nullopt;
}

std::string Store::AddReference(const web::Actor& actor, const std::string& scan_id,
                                const std::string& reason, const web::ReferencePlan& plan) {
  const std::int64_t scan = RequireId(scan_id, "scan");
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  std::int64_t patient = 0;
  {
    Statement query =
        write_->Prepare("SELECT patient_id, outcome, has_folder FROM scans WHERE id = ?");
    if (!query.Bind(scan).Step())
      throw StoreRefusal(ChangeResult::kNotFound, "there is no such scan");
    if (query.Text(1) != "done" || query.Integer(2) == 0) {
      throw StoreRefusal(ChangeResult::kConflict,
                         "this scan has no scene: only a finished scan can become a reference");
    }
    patient = query.Integer(0);
  }
  write_
      ->Prepare(
          "INSERT INTO refs (patient_id, version, scan_id, created_at, created_by, planned_by, "
          "reason, plan) VALUES (?,"
          " 1 + (SELECT ifnull(max(version), 0) FROM refs WHERE patient_id = ?), ?, ?, ?, ?, ?, ?)")
      .Bind(patient)
      .Bind(patient)
      .Bind(scan)
      .Bind(Now())
      .Bind(actor.user)
      .Bind(actor.user)
      .Bind(reason)
      .Bind(PlanJson(plan))
      .Run();
  const std::string id = std::to_string(write_->last_id());
  Write(actor, "reference.add", id, "scan " + scan_id);
  transaction.Commit();
  return id;
}

namespace {

void RequireRevision(std::int64_t stored, int read) {
  if (stored != read)
    throw StoreRefusal(ChangeResult::kConflict,
                       "this plan has been changed by somebody else meanwhile: look at it again");
}

}  // namespace

std::string Store::PlanReference(const web::Actor& actor, const std::string& id, int revision,
                                 const web::ReferencePlan& plan) {
  const std::int64_t number = RequireId(id, "reference");
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  bool is_approved = false;
  {
    Statement query = write_->Prepare("SELECT approved_by, revision FROM refs WHERE id = ?");
    if (!query.Bind(number).Step())
      throw StoreRefusal(ChangeResult::kNotFound, "there is no such reference");
    is_approved = !query.Text(0).empty();
    RequireRevision(query.Integer(1), revision);
  }
  std::string changed = id;
  if (is_approved) {
    write_
        ->Prepare(
            "INSERT INTO refs (patient_id, version, scan_id, created_at, created_by, planned_by, "
            "reason, plan)"
            " SELECT patient_id, 1 + (SELECT max(version) FROM refs AS r WHERE r.patient_id = "
            "refs.patient_id), scan_id, ?, ?, ?,"
            " 'new plan of version ' || version, ? FROM refs WHERE id = ?")
        .Bind(Now())
        .Bind(actor.user)
        .Bind(actor.user)
        .Bind(PlanJson(plan))
        .Bind(number)
        .Run();
    changed = std::to_string(write_->last_id());
  } else {
    write_
        ->Prepare("UPDATE refs SET plan = ?, planned_by = ?, revision = revision + 1 WHERE id = ?")
        .Bind(PlanJson(plan))
        .Bind(actor.user)
        .Bind(number)
        .Run();
  }
  Write(actor, "reference.plan", changed, PlanJson(plan));
  transaction.Commit();
  return changed;
}

void Store::ApproveReference(const web::Actor& actor, const std::string& id, int revision,
                             const std::string& digest, bool two_users) {
  const std::int64_t number = RequireId(id, "reference");
  if (const std::optional<web::Reference> reference = FindReference(id)) {  // before the lock
    const std::string fault = CheckFiles(reference->scan_id, /*scene_only=*/true);
    if (!fault.empty())
      throw StoreRefusal(ChangeResult::kConflict,
                         fmt::format("the scan of this reference is not as it was stored: {}; put "
                                     "a backup of its files in their place, or scan again",
                                     fault));
  }
  std::string signed_digest;
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  {
    Statement query = write_->Prepare(
        "SELECT approved_by, created_by, planned_by, revision, patient_id, version, scan_id, plan "
        "FROM refs WHERE id = ?");
    if (!query.Bind(number).Step())
      throw StoreRefusal(ChangeResult::kNotFound, "there is no such reference");
    if (!query.Text(0).empty())
      throw StoreRefusal(ChangeResult::kConflict, "this reference is approved already");
    RequireRevision(query.Integer(3), revision);
    signed_digest = DigestOf(query.Text(4), static_cast<int>(query.Integer(5)),
                             ScanId(query.Integer(6)), query.Text(7));
    if (!digest.empty() && digest != signed_digest)
      throw StoreRefusal(ChangeResult::kConflict,
                         "what is stored is not what was shown: look at the reference again");
    if (two_users && (query.Text(1) == actor.user || query.Text(2) == actor.user)) {
      throw StoreRefusal(
          ChangeResult::kRefused,
          "who made or planned a reference does not approve it: ask a second person");
    }
  }
  write_->Prepare("UPDATE refs SET approved_by = ?, approved_at = ? WHERE id = ?")
      .Bind(actor.user)
      .Bind(Now())
      .Bind(number)
      .Run();
  Write(actor, "reference.approve", id, "sha256 " + signed_digest);
  transaction.Commit();
}

}  // namespace plumb
