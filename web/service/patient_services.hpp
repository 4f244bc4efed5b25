// SPDX-License-Identifier: Apache-2.0
// Patients with their treatment sessions, and the references that fractions are compared with.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "web/model/account.hpp"
#include "web/model/change.hpp"
#include "web/model/patient.hpp"
#include "web/model/reference.hpp"
#include "web/model/scan.hpp"
#include "web/model/status.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class PatientService {
 public:
  virtual ~PatientService() = default;

  [[nodiscard]] virtual std::vector<Patient>
  Patients() = 0;  ///< By code; at most 1000 (background).
  [[nodiscard]] virtual std::optional<Patient> FindPatient(const std::string& id) = 0;
  virtual void AddPatient(const Actor& actor, const std::string& code, const std::string& site,
                          Done done) = 0;  ///< Returns the id.
  /// @param shown  What the person has seen; kConflict if something else is stored by now. Not set:
  ///        what is stored is replaced in any case.
  virtual void ChangePatient(const Actor& actor, const std::string& id, const CourseNotes& wanted,
                             const std::optional<CourseNotes>& shown, Done done) = 0;
  /// The photo of the set-up sheet as JPEG; nothing if there is none (background).
  [[nodiscard]] virtual std::optional<std::string> Photo(const std::string& id) = 0;
  /// What was drawn over another picture goes with it.
  /// @param take  Makes the JPEG, at most kMaxPhoto bytes, where it holds up nothing. Empty: the
  ///        photo is removed.
  virtual void SetPhoto(const Actor& actor, const std::string& id,
                        std::function<std::string()> take, Done done) = 0;
  /// What was drawn on the set-up sheet; empty if nothing (background).
  [[nodiscard]] virtual std::vector<DrawnPoint> Drawing(const std::string& id) = 0;
  /// @param points  At most kMaxDrawnPoints; none: the drawing is removed.
  /// @param revision  Patient::sheet_revision as the person has seen it; kConflict for another one.
  virtual void SetDrawing(const Actor& actor, const std::string& id,
                          const std::vector<DrawnPoint>& points, int revision, Done done) = 0;
  /// Moves the patient to the archive or back. kConflict while a session of the patient is open.
  virtual void ArchivePatient(const Actor& actor, const std::string& id, bool archived,
                              Done done) = 0;
  /// Removes the patient with scans, references and files ("wipe patient"); the audit log records
  /// it.
  virtual void WipePatient(const Actor& actor, const std::string& id, Done done) = 0;
  /// Begins a treatment session: until it is closed, scans from any button belong to this patient
  /// and purpose. Returns the session's id. No effect for the patient and purpose of the open
  /// session.
  /// @param reason    Reason for a new reference; may be empty.
  /// @param replaces  The open session that the user has seen and ends by this; kConflict if
  ///         another patient's is open.
  virtual void OpenPatient(const Actor& actor, const std::string& id, ScanPurpose purpose,
                           const std::string& reason, const std::string& replaces, Done done) = 0;
  /// Opens a session again that Patient::last_session names.
  /// @param replaces  As in OpenPatient(), also for another session of the same patient.
  virtual void ResumeSession(const Actor& actor, const std::string& session_id,
                             const std::string& replaces, Done done) = 0;
  /// The wristband of the patient on the couch carries this code: the next sweep of that session
  /// may begin. kConflict where it is another patient's, or another session is open.
  virtual void ConfirmWristband(const Actor& actor, const std::string& session_id,
                                const std::string& code, Done done) = 0;
  /// Corrects the number of a session for fractions, open or closed.
  virtual void CorrectFraction(const Actor& actor, const std::string& session_id, int fraction,
                               const std::string& reason, Done done) = 0;
  /// The session is compared with this reference from now on. kConflict during a scan, if another
  /// session is open, or if it is not the newest approved reference of its patient from its source.
  virtual void UseReference(const Actor& actor, const std::string& session_id,
                            const std::string& reference_id, Done done) = 0;
  /// Ends the treatment session. kConflict during a scan, or if another session is open.
  virtual void CloseSession(const Actor& actor, const std::string& session_id, Done done) = 0;
};

/// The files of a planning CT as they were sent.
struct SentPlanning {
  /// The structure set, followed by the plan, and by images, each behind its size in 8 bytes.
  std::filesystem::path file;
  std::uint64_t structures_bytes = 0;  ///< 0: no structure set, only with images.
  std::uint64_t plan_bytes = 0;        ///< 0: up to the end of the file.
  /// A person wants the skin of CT images at so many Hounsfield units, where there is no external
  /// contour. Not set: there are no images.
  std::optional<double> threshold_hu;
  std::vector<std::filesystem::path> images;  ///< Those that were received; empty: as sent.
  std::string roi;     ///< The contour that is the skin; empty: as the file states it.
  std::string beam;    ///< Whose isocentre counts; empty: all have the same.
  std::string reason;  ///< Reason for a new reference; may be empty.
  /// A person has looked: they are this patient's, although nothing shows it. Needs a reason.
  bool is_same_patient = false;
};

/// What an approval states about the doubts that there are: kConflict without it.
struct Considered {
  std::string reason;    ///< Why the scan's cautions (ScanQuality) do not matter.
  bool posture = false;  ///< The posture is right although RoomOnMap::contradicts_posture is set.
  /// The surface is that of the body although it is the skin of CT images, not a contour that a
  /// person has drawn.
  bool images = false;
};

/// The rules of services.hpp hold.
class ReferenceService {
 public:
  virtual ~ReferenceService() = default;

  [[nodiscard]] virtual std::vector<Reference> References(
      const std::string& patient_id) = 0;  ///< Newest version first (background).
  [[nodiscard]] virtual std::optional<Reference> FindReference(const std::string& id) = 0;
  /// The room on the maps of its scan, by the room's markers that the scan contains: the reference
  /// marker may have lain otherwise than when the room was calibrated (background).
  [[nodiscard]] virtual RoomOnMap RoomOfReference(const Reference& reference) = 0;
  /// Creates a draft from a scan with a scene. Returns the id.
  virtual void AddReference(const Actor& actor, const std::string& scan_id,
                            const std::string& reason, Done done) = 0;
  /// Creates a draft from a planning CT: isocentre and posture are the plan's, and no later plan
  /// changes them. Returns the id. kInvalid for files that do not belong together or must not be
  /// used, kFailed without a reader, kConflict while a session of the patient is open, and where
  /// the Patient ID of the files is not that of earlier ones or is another patient's here.
  virtual void AddPlanning(const Actor& actor, const std::string& patient_id,
                           const SentPlanning& sent, Done done) = 0;
  /// A draft is changed in place. For an approved reference, creates a new draft with the next
  /// version and returns its id.
  /// @param revision  The revision that was read: kConflict if another has been saved since.
  virtual void PlanReference(const Actor& actor, const std::string& id, int revision,
                             const ReferencePlan& plan, Done done) = 0;
  /// kRefused for the user who created or last planned it. After approval it is immutable and used
  /// for the comparison of fractions.
  /// @param revision  The revision that was read, as above.
  /// @param digest    Digest of the data that was read and is signed; kConflict if other data is
  ///         stored. Empty: only the revision is checked.
  virtual void ApproveReference(const Actor& actor, const std::string& id, int revision,
                                const std::string& digest, const Considered& considered,
                                Done done) = 0;
};

}  // namespace plumb::web
