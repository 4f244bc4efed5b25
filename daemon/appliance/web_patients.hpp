// The page's service for patients.
#pragma once

#include "daemon/appliance/store_access.hpp"
#include "web/service/patient_service.hpp"

namespace plumb {

/// Its arguments are borrowed.
class WebPatients : public web::PatientService {
 public:
  WebPatients(Appliance& appliance, StoreAccess& store) : appliance_(appliance), store_(store) {}

  [[nodiscard]] std::vector<web::Patient> Patients() override;
  [[nodiscard]] std::optional<web::Patient> FindPatient(const std::string& id) override;
  void AddPatient(const web::Actor& actor, const std::string& code, const std::string& site,
                  web::Done done) override;
  void ChangePatient(const web::Actor& actor, const std::string& id, const web::CourseNotes& wanted,
                     const std::optional<web::CourseNotes>& shown, web::Done done) override;
  void ArchivePatient(const web::Actor& actor, const std::string& id, bool archived,
                      web::Done done) override;
  void WipePatient(const web::Actor& actor, const std::string& id, web::Done done) override;
  void OpenPatient(const web::Actor& actor, const std::string& id, web::ScanPurpose purpose,
                   const std::string& reason, const std::string& replaces, web::Done done) override;
  void CloseSession(const web::Actor& actor, const std::string& session_id,
                    web::Done done) override;

 private:
  Appliance& appliance_;
  StoreAccess& store_;
};

}  // namespace plumb
