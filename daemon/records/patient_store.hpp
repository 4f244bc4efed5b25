// SPDX-License-Identifier: Apache-2.0
// The patients and their treatment sessions. StoreRemoval removes them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/database/store_database.hpp"
#include "web/model/account.hpp"
#include "web/model/patient.hpp"
#include "web/model/scan.hpp"

namespace plumb {

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class PatientStore {
 public:
  explicit PatientStore(StoreDatabase& database) : database_(database) {}

  [[nodiscard]] std::vector<Patient> List();  ///< By code.
  /// With the session that can be resumed.
  [[nodiscard]] std::optional<Patient> Find(const std::string& id);
  /// Letter case is ignored.
  [[nodiscard]] std::optional<Patient> FindByCode(const std::string& code);
  /// Returns the id. kConflict for a code that another patient has.
  std::string Add(const Actor& actor, const std::string& code, const std::string& site);
  /// @param shown  What the person has seen; kConflict if something else is stored by now. Not set:
  ///        what is stored is replaced in any case.
  void Change(const Actor& actor, const std::string& id, const CourseNotes& wanted,
              const std::optional<CourseNotes>& shown = {});
  /// JPEG; nothing if there is none, or if it is not one.
  [[nodiscard]] std::optional<std::string> Photo(const std::string& id);
  /// kInvalid for more than kMaxPhoto bytes. @param jpeg  Empty: it is removed.
  /// A drawing goes with the picture that it was made over.
  void SetPhoto(const Actor& actor, const std::string& id, const std::string& jpeg);
  /// Nothing if what is stored is no drawing.
  [[nodiscard]] std::vector<DrawnPoint> Drawing(const std::string& id);
  /// Kept to a thousandth of the picture. kConflict unless `revision` is Patient::sheet_revision.
  void SetDrawing(const Actor& actor, const std::string& id, const std::vector<DrawnPoint>& points,
                  int revision);
  /// kConflict while a session of the patient is open.
  void Archive(const Actor& actor, const std::string& id, bool archived);

 private:
  StoreDatabase& database_;
};

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class TreatmentStore {
 public:
  explicit TreatmentStore(StoreDatabase& database) : database_(database) {}

  /// Closes the open session, if any, and opens one. Returns the id. One for fractions keeps the
  /// reference that is approved now.
  std::string Open(const Actor& actor, const std::string& patient_id, ScanPurpose purpose);
  /// Opens a session again that Patient::last_session names, and closes the one that is open, if
  /// any. It goes on with its fraction and its reference. kConflict for any other session.
  void Resume(const Actor& actor, const std::string& session_id);
  /// The patient of a session, open or closed.
  [[nodiscard]] std::optional<std::string> PatientOf(const std::string& session_id);
  /// Corrects the number of a session for fractions.
  void CorrectFraction(const Actor& actor, const std::string& session_id, int fraction,
                       const std::string& reason);
  /// From now on the open session is compared with this reference. kConflict unless it is the
  /// newest approved one of its patient and its source.
  void UseReference(const Actor& actor, const std::string& session_id,
                    const std::string& reference_id);
  void CloseAll(const Actor& actor);
  [[nodiscard]] std::optional<TreatmentSession> Opened();

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
