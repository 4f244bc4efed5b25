// SPDX-License-Identifier: Apache-2.0
// References: the scans with which later ones are compared, each with its plan.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/database/store_database.hpp"
#include "daemon/records/file_integrity.hpp"
#include "web/model/account.hpp"
#include "web/model/reference.hpp"

namespace plumb {

/// The planning CTs that were imported.
struct KnownPlanning {
  int version = 0;           ///< Of the patient's newest; 0: there is none.
  std::string patient_hash;  ///< Its ReferenceOrigin::patient_hash.
  std::string
      other_code;  ///< Of another patient whose files have the same hash; empty if none has.
};

/// Doubts about a reference that the approver has looked at, for the log.
struct ConfirmedDoubts {
  bool posture = false;                          ///< The surface speaks against it.
  std::optional<double> skin_threshold_hu = {};  ///< Its skin is that of CT images.
};

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds, and DataError
/// for a plan that cannot be read, which is never replaced by a default.
class ReferenceStore {
 public:
  ReferenceStore(StoreDatabase& database, FileIntegrity& integrity)
      : database_(database), integrity_(integrity) {}

  /// Drafts that are newer than the approved version of their patient; at most 20.
  [[nodiscard]] std::vector<WaitingReference> Waiting();
  /// Newest first. An unreadable one is marked and does not hide others.
  [[nodiscard]] std::vector<Reference> List(const std::string& patient_id);
  [[nodiscard]] std::optional<Reference> Find(const std::string& id);
  [[nodiscard]] std::optional<Reference> Approved(const std::string& patient_id);
  /// What scans of this session are compared with; nothing before one is approved.
  [[nodiscard]] std::optional<Reference> OfSession(const std::string& session_id);

  /// Whose planning CTs are known; `hash` of one that is to be imported for that patient.
  [[nodiscard]] KnownPlanning PlanningOf(const std::string& patient_id, const std::string& hash);

  /// Creates a draft. Returns the id.
  std::string Add(const Actor& actor, const std::string& scan_id, const std::string& reason,
                  const ReferencePlan& plan, const ReferenceOrigin& origin = {});
  /// Changes a draft, or creates a new version of an approved reference. Returns the id.
  /// @param revision  The revision that was read; kConflict if another one has been saved since.
  std::string Plan(const Actor& actor, const std::string& id, int revision,
                   const ReferencePlan& plan);
  /// @param digest  Digest of the data that was read and is signed; kConflict if another one is
  ///         stored. Empty: not compared.
  /// @param two_users  The approver must be another person than the one who created or planned it;
  ///         false only for the demo's "auto".
  /// @param reason  Why a scan with cautions becomes the reference, for the log; may be empty.
  void Approve(const Actor& actor, const std::string& id, int revision,
               const std::string& digest = {}, bool two_users = true,
               const std::string& reason = {}, const ConfirmedDoubts& confirmed = {});

 private:
  StoreDatabase& database_;
  FileIntegrity& integrity_;
};

}  // namespace plumb
