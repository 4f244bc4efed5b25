// SPDX-License-Identifier: Apache-2.0
#include "daemon/records/reference_store.hpp"

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/parse_number.hpp"
#include "daemon/database/row_digests.hpp"
#include "daemon/database/store_json.hpp"
#include "daemon/database/store_refusal.hpp"
#include "daemon/database/stored_values.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

const std::string kReferenceColumns =
    "SELECT id, patient_id, version, scan_id, created_at, created_by, reason, approved_by, "
    "approved_at, plan, revision, planned_by, (SELECT group_concat(path || ' ' || sha256, "
    "char(10)) FROM (SELECT path, sha256 FROM scan_files WHERE scan_files.scan_id = refs.scan_id "
    "AND path LIKE 'scene/%' ORDER BY path)), approved_digest, source, patient_hash FROM refs ";

/// SHA-256 of the data that an approval signs: all that the summary shows, and the files of the
/// surface that later scans are compared with.
std::string DigestOf(const Statement& row) {
  return Sha256Of(fmt::format("patient {}\nversion {}\nscan {}\nreason {}\n{}\n{}", row.Text(1),
                              row.Integer(2), ScanId(row.Integer(3)), row.Text(6), row.Text(9),
                              row.Text(12)));
}

/// Whether the reference is what its approval signed. The row has no digest if 0.1.0 approved it,
/// or 0.2.0 after an update was rolled back.
bool IsAsApproved(const Statement& row) {
  const std::string approved = row.Text(13);
  return row.Text(7).empty() || approved.empty() || approved == DigestOf(row);
}

/// @throws DataError naming the version whose plan cannot be read, or is not the one that was
/// approved: it must not be used.
ReferencePlan PlanIn(const Statement& row) {
  if (!IsAsApproved(row)) throw DataError(say::store::ReferenceNotAsApproved(row.Integer(2)));
  try {
    return ParsePlan(row.Text(9));
  } catch (const DataError& error) {
    throw DataError(say::store::ReferenceVersion(row.Integer(2), error.message()));
  }
}

/// What somebody wrote, or Plumb's own sentence of Plan().
Message ReasonIn(const std::string& stored) {
  const std::string begin = say::store::ReferenceNewPlan(0).English();
  const std::string_view head = std::string_view(begin).substr(0, begin.size() - 1);
  if (stored.starts_with(head)) {
    if (const auto version = ParseNumber<int>(std::string_view(stored).substr(head.size())))
      return say::store::ReferenceNewPlan(*version);
  }
  return Message::Verbatim(stored);
}

/// Without its plan.
Reference ReadReferenceRow(const Statement& row) {
  Reference reference{.id = row.Text(0),
                      .patient_id = row.Text(1),
                      .version = static_cast<int>(row.Integer(2)),
                      .scan_id = ScanId(row.Integer(3)),
                      .created_at = FromStored(row.Integer(4)),
                      .created_by = row.Text(5),
                      .reason = ReasonIn(row.Text(6)),
                      .revision = static_cast<int>(row.Integer(10)),
                      .planned_by = row.Text(11),
                      .approved_by = row.Text(7)};
  if (!row.IsNull(8)) reference.approved_at = FromStored(row.Integer(8));
  reference.digest = DigestOf(row);
  reference.origin = {.source = ParseStored<ReferenceSource>("source", row.Text(14)),
                      .patient_hash = row.Text(15)};
  return reference;
}

/// @throws DataError if the plan cannot be read; it is never replaced by a default.
Reference ReadReference(const Statement& row) {
  Reference reference = ReadReferenceRow(row);
  reference.plan = PlanIn(row);
  return reference;
}

/// For lists: an unreadable one does not hide the others.
Reference ListReference(const Statement& row) {
  Reference reference = ReadReferenceRow(row);
  try {
    reference.plan = PlanIn(row);
  } catch (const DataError& error) {
    reference.unreadable = error.message();
  }
  return reference;
}

void RequireRevision(std::int64_t stored, int read) {
  if (stored != read)
    throw StoreRefusal(ChangeResult::kConflict, say::store::ReferencePlanChanged());
}

/// One person plans, another approves.
void RequireSecondPerson(const Reference& reference, const Actor& approver) {
  if (reference.planned_by.empty())
    throw StoreRefusal(ChangeResult::kConflict, say::store::ReferenceNotPlanned());
  if (reference.created_by == approver.user || reference.planned_by == approver.user)
    throw StoreRefusal(ChangeResult::kRefused, say::store::ReferenceSecondPerson());
}

/// @throws DatabaseCorrupt if the row is not as it was written
std::optional<Reference> AsSigned(Database& rows, std::optional<Reference> reference) {
  if (reference) RequireRow(rows, RowKind::kReference, reference->id);
  return reference;
}

}  // namespace

std::vector<WaitingReference> ReferenceStore::Waiting() {
  return database_.ForRows()->All(
      "SELECT refs.id, patient_id, code, version, planned_by FROM refs JOIN patients ON "
      "patients.id = patient_id WHERE archived = 0 AND approved_by = '' AND version > (SELECT "
      "ifnull(max(version), 0) FROM refs AS r WHERE r.patient_id = refs.patient_id AND "
      "r.approved_by <> '') AND NOT EXISTS (SELECT 1 FROM refs AS newer WHERE newer.patient_id = "
      "refs.patient_id AND newer.version > refs.version) ORDER BY refs.id DESC LIMIT 20",
      [](const Statement& row) {
        return WaitingReference{.reference_id = row.Text(0),
                                .patient_id = row.Text(1),
                                .patient_code = row.Text(2),
                                .version = static_cast<int>(row.Integer(3)),
                                .planned_by = row.Text(4)};
      });
}

std::vector<Reference> ReferenceStore::List(const std::string& patient_id) {
  return database_.ForLists()->All(
      kReferenceColumns + "WHERE patient_id = ? ORDER BY version DESC LIMIT 1000", ListReference,
      ParseId(patient_id));
}

std::optional<Reference> ReferenceStore::Find(const std::string& id) {
  const StoreDatabase::Held rows = database_.ForRows();
  RequireRow(*rows, RowKind::kReference, id);
  return rows->First(kReferenceColumns + "WHERE id = ?", ReadReference, ParseId(id));
}

std::optional<Reference> ReferenceStore::Approved(const std::string& patient_id) {
  const StoreDatabase::Held rows = database_.ForRows();
  return AsSigned(*rows, rows->First(kReferenceColumns + "WHERE patient_id = ? AND approved_by <> "
                                                         "'' ORDER BY version DESC LIMIT 1",
                                     ReadReference, ParseId(patient_id)));
}

std::optional<Reference> ReferenceStore::OfSession(const std::string& session_id) {
  const StoreDatabase::Held rows = database_.ForRows();
  RequireRow(*rows, RowKind::kSession, session_id);
  return AsSigned(
      *rows,
      rows->First(
          kReferenceColumns +
              "WHERE id = (SELECT ifnull(reference_id, (SELECT id FROM refs WHERE refs.patient_id "
              "= sessions.patient_id AND approved_by <> '' ORDER BY version DESC LIMIT 1)) FROM "
              "sessions WHERE sessions.id = ?)",
          ReadReference, ParseId(session_id)));
}

KnownPlanning ReferenceStore::PlanningOf(const std::string& patient_id, const std::string& hash) {
  const std::optional<std::int64_t> patient = ParseId(patient_id);
  const StoreDatabase::Held rows = database_.ForRows();
  KnownPlanning known =
      rows->First(
              "SELECT version, patient_hash FROM refs WHERE patient_id = ? AND source = ? ORDER BY "
              "version DESC LIMIT 1",
              [](const Statement& row) {
                return KnownPlanning{.version = static_cast<int>(row.Integer(0)),
                                     .patient_hash = row.Text(1),
                                     .other_code = {}};
              },
              patient, Name(ReferenceSource::kPlanningCt))
          .value_or(KnownPlanning{});
  known.other_code =
      rows->FirstText(
              "SELECT code FROM patients WHERE id <> ?1 AND ?2 <> '' AND id IN (SELECT patient_id "
              "FROM refs WHERE patient_hash = ?2) LIMIT 1",
              patient, hash)
          .value_or("");
  return known;
}

std::string ReferenceStore::Add(const Actor& actor, const std::string& scan_id,
                                const std::string& reason, const ReferencePlan& plan,
                                const ReferenceOrigin& origin) {
  const std::int64_t scan = RequireId(scan_id, "scan");
  StoreChange change(database_);
  std::int64_t patient = 0;
  {
    Statement query =
        change->Prepare("SELECT patient_id, outcome, has_folder FROM scans WHERE id = ?", scan);
    if (!query.Step()) throw StoreRefusal(ChangeResult::kNotFound, say::store::NoScan());
    if (query.Text(1) != "done" || query.Integer(2) == 0) {
      throw StoreRefusal(ChangeResult::kConflict, say::store::ScanWithoutScene());
    }
    patient = query.Integer(0);
    if (patient == 0) {
      throw StoreRefusal(ChangeResult::kConflict, say::store::ScanWithoutPatient());
    }
  }
  change->Run(
      "INSERT INTO refs (patient_id, version, scan_id, created_at, created_by, planned_by, "
      "reason, plan, source, patient_hash) VALUES (?,"
      " 1 + (SELECT ifnull(max(version), 0) FROM refs WHERE patient_id = ?), ?, ?, ?, '', ?, "
      "?, ?, ?)",
      patient, patient, scan, StoredNow(), actor.user, reason, PlanJson(plan), Name(origin.source),
      origin.patient_hash);
  const std::string id = std::to_string(change->last_id());
  change.Log(actor, "reference.add", id,
             origin.confirmed.empty()
                 ? say::store::LogReferenceScan(scan_id)
                 : say::store::LogPatientConfirmed(scan_id, origin.confirmed, reason));
  change.Commit();
  return id;
}

std::string ReferenceStore::Plan(const Actor& actor, const std::string& id, int revision,
                                 const ReferencePlan& plan) {
  const std::int64_t number = RequireId(id, "reference");
  StoreChange change(database_);
  bool is_approved = false;
  std::string stored;
  {
    Statement query =
        change->Prepare("SELECT approved_by, revision, plan FROM refs WHERE id = ?", number);
    if (!query.Step()) throw StoreRefusal(ChangeResult::kNotFound, say::store::NoReference());
    is_approved = !query.Text(0).empty();
    RequireRevision(query.Integer(1), revision);
    stored = query.Text(2);
  }
  std::string changed = id;
  if (is_approved) {
    change->Run(
        "INSERT INTO refs (patient_id, version, scan_id, created_at, created_by, planned_by, "
        "reason, plan, source, patient_hash)"
        " SELECT patient_id, 1 + (SELECT max(version) FROM refs AS r WHERE r.patient_id = "
        "refs.patient_id), scan_id, ?, ?, ?,"
        " 'new plan of version ' || version, ?, source, patient_hash FROM refs WHERE id = ?",
        StoredNow(), actor.user, actor.user, PlanJson(plan), number);
    changed = std::to_string(change->last_id());
  } else {
    change->Run("UPDATE refs SET plan = ?, planned_by = ?, revision = revision + 1 WHERE id = ?",
                PlanJson(plan), actor.user, number);
  }
  // Both as they are stored: one that cannot be read is kept in the log as it was.
  change.Log(actor, "reference.plan", changed, Message::Verbatim(stored + "\n" + PlanJson(plan)));
  change.Commit();
  return changed;
}

void ReferenceStore::Approve(const Actor& actor, const std::string& id, int revision,
                             const std::string& digest, bool two_users, const std::string& reason,
                             const ConfirmedDoubts& confirmed) {
  const std::int64_t number = RequireId(id, "reference");
  if (const std::optional<Reference> reference = Find(id)) {  // before the lock is taken
    const Message fault = integrity_.Check(reference->scan_id, /*scene_only=*/true);
    if (!fault.empty())
      throw StoreRefusal(ChangeResult::kConflict, say::store::ReferenceScanChanged(fault));
  }
  StoreChange change(database_);
  const std::optional<Reference> reference =
      change->First(kReferenceColumns + "WHERE id = ?", ReadReferenceRow, number);
  if (!reference) throw StoreRefusal(ChangeResult::kNotFound, say::store::NoReference());
  if (!reference->approved_by.empty())
    throw StoreRefusal(ChangeResult::kConflict, say::store::ReferenceApproved());
  RequireRevision(reference->revision, revision);
  if (change->Has(
          "SELECT 1 FROM refs AS other JOIN refs ON other.patient_id = refs.patient_id AND "
          "other.version > refs.version WHERE refs.id = ? AND other.approved_by <> '' LIMIT 1",
          number))
    throw StoreRefusal(ChangeResult::kConflict, say::store::ReferenceNewerApproved());
  if (!digest.empty() && digest != reference->digest)
    throw StoreRefusal(ChangeResult::kConflict, say::store::ReferenceNotAsShown());
  if (two_users) RequireSecondPerson(*reference, actor);
  change->Run("UPDATE refs SET approved_by = ?, approved_at = ?, approved_digest = ? WHERE id = ?",
              actor.user, StoredNow(), reference->digest, number);
  Message approval = reason.empty() ? say::store::LogDigest(reference->digest)
                                    : say::store::LogDigestReason(reference->digest, reason);
  if (confirmed.posture) approval = say::store::LogPostureConfirmed(std::move(approval));
  if (const auto& skin_hu = confirmed.skin_threshold_hu)
    approval = say::store::LogImagesConfirmed(std::move(approval), *skin_hu);
  change.Log(actor, "reference.approve", id, approval);
  change.Commit();
}

}  // namespace plumb
