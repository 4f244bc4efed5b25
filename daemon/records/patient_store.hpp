// The patients and their treatment sessions. StoreRemoval removes them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/records/store_database.hpp"
#include "web/service/service_types.hpp"

namespace plumb {

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class PatientStore {
 public:
  explicit PatientStore(StoreDatabase& database) : database_(database) {}

  [[nodiscard]] std::vector<web::Patient> List();  ///< By code.
  [[nodiscard]] std::optional<web::Patient> Find(const std::string& id);
  /// Letter case is ignored.
  [[nodiscard]] std::optional<web::Patient> FindByCode(const std::string& code);
  /// Returns the id. kConflict for a code that another patient has.
  std::string Add(const web::Actor& actor, const std::string& code, const std::string& site);
  /// @param shown  What the person has seen; kConflict if something else is stored by now. Not set:
  ///        what is stored is replaced in any case.
  void Change(const web::Actor& actor, const std::string& id, const std::string& site,
              const std::string& note, const std::optional<web::CourseNotes>& shown = {});
  /// kConflict while a session of the patient is open.
  void Archive(const web::Actor& actor, const std::string& id, bool archived);

 private:
  StoreDatabase& database_;
};

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class TreatmentStore {
 public:
  explicit TreatmentStore(StoreDatabase& database) : database_(database) {}

  /// Closes the open session, if any, and opens one. Returns the id.
  std::string Open(const web::Actor& actor, const std::string& patient_id,
                   web::ScanPurpose purpose);
  void CloseAll(const web::Actor& actor);
  [[nodiscard]] std::optional<web::TreatmentSession> Opened();

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
