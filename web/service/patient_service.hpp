// Patients and their treatment sessions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "web/service/change.hpp"
#include "web/service/service_types.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class PatientService {
 public:
  virtual ~PatientService() = default;

  [[nodiscard]] virtual std::vector<Patient> Patients() = 0;  ///< By code; at most 1000 (aside).
  [[nodiscard]] virtual std::optional<Patient> FindPatient(const std::string& id) = 0;
  virtual void AddPatient(const Actor& actor, const std::string& code, const std::string& site,
                          Done done) = 0;  ///< Gives the id.
  virtual void ChangePatient(const Actor& actor, const std::string& id, const std::string& site,
                             const std::string& note, Done done) = 0;
  /// Out of the list, or back into it. kConflict while a session of the patient is open.
  virtual void ArchivePatient(const Actor& actor, const std::string& id, bool archived,
                              Done done) = 0;
  /// Removes the patient with scans, references and files ("wipe patient"); the audit log keeps
  /// that it was done.
  virtual void WipePatient(const Actor& actor, const std::string& id, Done done) = 0;
  /// Begins a treatment session: scans, from any button, are of this patient and for this until it
  /// is closed. Gives the session's id. For the patient and purpose of the open session nothing
  /// changes.
  /// @param reason    Why a new reference is taken; may be empty.
  /// @param replaces  The open session that the person has seen and ends with this; kConflict where
  ///                  another patient's is open.
  virtual void OpenPatient(const Actor& actor, const std::string& id, ScanPurpose purpose,
                           const std::string& reason, const std::string& replaces, Done done) = 0;
  /// Ends the treatment session. kConflict during a scan, or where another one is open by now.
  virtual void CloseSession(const Actor& actor, const std::string& session_id, Done done) = 0;
};

}  // namespace plumb::web
