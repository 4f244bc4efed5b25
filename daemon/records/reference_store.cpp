#include "daemon/records/reference_store.hpp"

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/records/store_json.hpp"
#include "daemon/records/store_refusal.hpp"
#include "daemon/records/stored_values.hpp"

namespace plumb {
namespace {

const std::string kReferenceColumns =
    "SELECT id, patient_id, version, scan_id, created_at, created_by, reason, approved_by, "
    "approved_at, plan, revision, planned_by, (SELECT group_concat(path || ' ' || sha256, "
    "char(10)) FROM (SELECT path, sha256 FROM scan_files WHERE scan_files.scan_id = refs.scan_id "
    "AND path LIKE 'scene/%' ORDER BY path)) FROM refs ";

/// SHA-256 of the data that an approval signs: all that the summary shows, and the files of the
/// surface that later scans are compared with.
std::string DigestOf(const Statement& row) {
  return Sha256Of(fmt::format("patient {}\nversion {}\nscan {}\nreason {}\n{}\n{}", row.Text(1),
                              row.Integer(2), ScanId(row.Integer(3)), row.Text(6), row.Text(9),
                              row.Text(12)));
}

/// @throws DataError naming the version whose plan cannot be read: it must not be used.
ReferencePlan PlanIn(const Statement& row) {
  try {
    return ParsePlan(row.Text(9));
  } catch (const DataError& error) {
    throw DataError(fmt::format("version {} of the reference: {}", row.Integer(2), error.what()));
  }
}

/// Without its plan.
Reference ReadReferenceRow(const Statement& row) {
  Reference reference{.id = row.Text(0),
                      .patient_id = row.Text(1),
                      .version = static_cast<int>(row.Integer(2)),
                      .scan_id = ScanId(row.Integer(3)),
                      .created_at = FromStored(row.Integer(4)),
                      .created_by = row.Text(5),
                      .reason = row.Text(6),
                      .revision = static_cast<int>(row.Integer(10)),
                      .planned_by = row.Text(11),
                      .approved_by = row.Text(7)};
  if (!row.IsNull(8)) reference.approved_at = FromStored(row.Integer(8));
  reference.digest = DigestOf(row);
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
    reference.unreadable = error.what();
  }
  return reference;
}

void RequireRevision(std::int64_t stored, int read) {
  if (stored != read)
    throw StoreRefusal(ChangeResult::kConflict,
                       "this plan has been changed by somebody else meanwhile: look at it again");
}

/// One person plans, another approves.
void RequireSecondPerson(const Reference& reference, const Actor& approver) {
  if (reference.planned_by.empty())
    throw StoreRefusal(ChangeResult::kConflict,
                       "nobody has planned this reference: save its plan first");
  if (reference.created_by == approver.user || reference.planned_by == approver.user)
    throw StoreRefusal(ChangeResult::kRefused,
                       "who made or planned a reference does not approve it: ask a second person");
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
  return database_.ForRows()->First(kReferenceColumns + "WHERE id = ?", ReadReference, ParseId(id));
}

std::optional<Reference> ReferenceStore::Approved(const std::string& patient_id) {
  return database_.ForRows()->First(
      kReferenceColumns +
          "WHERE patient_id = ? AND approved_by <> '' ORDER BY version DESC LIMIT 1",
      ReadReference, ParseId(patient_id));
}

std::string ReferenceStore::Add(const Actor& actor, const std::string& scan_id,
                                const std::string& reason, const ReferencePlan& plan) {
  const std::int64_t scan = RequireId(scan_id, "scan");
  StoreChange change(database_);
  std::int64_t patient = 0;
  {
    Statement query =
        change->Prepare("SELECT patient_id, outcome, has_folder FROM scans WHERE id = ?", scan);
    if (!query.Step()) throw StoreRefusal(ChangeResult::kNotFound, "there is no such scan");
    if (query.Text(1) != "done" || query.Integer(2) == 0) {
      throw StoreRefusal(ChangeResult::kConflict,
                         "this scan has no scene: only a finished scan can become a reference");
    }
    patient = query.Integer(0);
    if (patient == 0) {
      throw StoreRefusal(
          ChangeResult::kConflict,
          "this scan belongs to no patient: open the patient, then scan a reference");
    }
  }
  change->Run(
      "INSERT INTO refs (patient_id, version, scan_id, created_at, created_by, planned_by, "
      "reason, plan) VALUES (?,"
      " 1 + (SELECT ifnull(max(version), 0) FROM refs WHERE patient_id = ?), ?, ?, ?, '', ?, "
      "?)",
      patient, patient, scan, StoredNow(), actor.user, reason, PlanJson(plan));
  const std::string id = std::to_string(change->last_id());
  change.Log(actor, "reference.add", id, "scan " + scan_id);
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
    if (!query.Step()) throw StoreRefusal(ChangeResult::kNotFound, "there is no such reference");
    is_approved = !query.Text(0).empty();
    RequireRevision(query.Integer(1), revision);
    stored = query.Text(2);
  }
  std::string changed = id;
  if (is_approved) {
    change->Run(
        "INSERT INTO refs (patient_id, version, scan_id, created_at, created_by, planned_by, "
        "reason, plan)"
        " SELECT patient_id, 1 + (SELECT max(version) FROM refs AS r WHERE r.patient_id = "
        "refs.patient_id), scan_id, ?, ?, ?,"
        " 'new plan of version ' || version, ? FROM refs WHERE id = ?",
        StoredNow(), actor.user, actor.user, PlanJson(plan), number);
    changed = std::to_string(change->last_id());
  } else {
    change->Run("UPDATE refs SET plan = ?, planned_by = ?, revision = revision + 1 WHERE id = ?",
                PlanJson(plan), actor.user, number);
  }
  // Both as they are stored: one that cannot be read is kept in the log as it was.
  change.Log(actor, "reference.plan", changed, stored + "\n" + PlanJson(plan));
  change.Commit();
  return changed;
}

void ReferenceStore::Approve(const Actor& actor, const std::string& id, int revision,
                             const std::string& digest, bool two_users) {
  const std::int64_t number = RequireId(id, "reference");
  if (const std::optional<Reference> reference = Find(id)) {  // before the lock is taken
    const std::string fault = integrity_.Check(reference->scan_id, /*scene_only=*/true);
    if (!fault.empty())
      throw StoreRefusal(ChangeResult::kConflict,
                         fmt::format("the scan of this reference is not as it was stored: {}; put "
                                     "a backup of its files in their place, or scan again",
                                     fault));
  }
  StoreChange change(database_);
  const std::optional<Reference> reference =
      change->First(kReferenceColumns + "WHERE id = ?", ReadReferenceRow, number);
  if (!reference) throw StoreRefusal(ChangeResult::kNotFound, "there is no such reference");
  if (!reference->approved_by.empty())
    throw StoreRefusal(ChangeResult::kConflict, "this reference is approved already");
  RequireRevision(reference->revision, revision);
  if (change->Has(
          "SELECT 1 FROM refs AS other JOIN refs ON other.patient_id = refs.patient_id AND "
          "other.version > refs.version WHERE refs.id = ? AND other.approved_by <> '' LIMIT 1",
          number))
    throw StoreRefusal(ChangeResult::kConflict,
                       "a newer version of this reference is approved, and scans are compared "
                       "with the newest: change the plan of that one");
  if (!digest.empty() && digest != reference->digest)
    throw StoreRefusal(ChangeResult::kConflict,
                       "what is stored is not what was shown: look at the reference again");
  if (two_users) RequireSecondPerson(*reference, actor);
  change->Run("UPDATE refs SET approved_by = ?, approved_at = ? WHERE id = ?", actor.user,
              StoredNow(), number);
  change.Log(actor, "reference.approve", id, "sha256 " + reference->digest);
  change.Commit();
}

}  // namespace plumb
