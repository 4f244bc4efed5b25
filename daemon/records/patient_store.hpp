// The patients and their treatment sessions. StoreRemoval removes them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/records/store_database.hpp"
#include "web/model/account.hpp"
#include "web/model/patient.hpp"
#include "web/model/scan.hpp"

namespace plumb {

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class PatientStore {
 public:
  explicit PatientStore(StoreDatabase& database) : database_(database) {}

  [[nodiscard]] std::vector<Patient> List();  ///< By code.
  [[nodiscard]] std::optional<Patient> Find(const std::string& id);
  /// Letter case is ignored.
  [[nodiscard]] std::optional<Patient> FindByCode(const std::string& code);
  /// Returns the id. kConflict for a code that another patient has.
  std::string Add(const Actor& actor, const std::string& code, const std::string& site);
  /// @param shown  What the person has seen; kConflict if something else is stored by now. Not set:
  ///        what is stored is replaced in any case.
  void Change(const Actor& actor, const std::string& id, const std::string& site,
              const std::string& note, const std::optional<CourseNotes>& shown = {});
  /// kConflict while a session of the patient is open.
  void Archive(const Actor& actor, const std::string& id, bool archived);

 private:
  StoreDatabase& database_;
};

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class TreatmentStore {
 public:
  explicit TreatmentStore(StoreDatabase& database) : database_(database) {}

  /// Closes the open session, if any, and opens one. Returns the id.
  std::string Open(const Actor& actor, const std::string& patient_id, ScanPurpose purpose);
  void CloseAll(const Actor& actor);
  [[nodiscard]] std::optional<TreatmentSession> Opened();

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
