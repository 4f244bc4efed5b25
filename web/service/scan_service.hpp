// What the web asks of the appliance. The daemon implements it; the web only calls.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "web/service/service_types.hpp"

namespace plumb::web {

enum class ChangeResult {
  kDone,
  kInvalid,   ///< The request makes no sense; the message says what was expected and found.
  kNotFound,  ///< No such patient, reference, scan or user.
  kConflict,  ///< Not in this state: "in state X, trying f(), requires Y".
  kRefused,   ///< This user may not, here: the one who made a reference does not approve it.
  kNoSpace,   ///< Disk full or read-only.
  kFailed,
};

/// The answer to a change.
struct Change {
  ChangeResult result = ChangeResult::kDone;
  std::string message;         ///< For people; empty when done.
  std::string id;              ///< Of what was made, where something was.
  std::filesystem::path file;  ///< Of what was written, where something was.
};
/// Called exactly once, on the loop thread: within the call that asked, or later.
using Done = std::function<void(const Change&)>;

enum class EventKind {
  kStatus,    ///< State, sensor, light, storage: ask Status().
  kProgress,  ///< Of a scan: ask Status().
  kResult,    ///< A scan ended: ask Status().
  kData,      ///< Patients, references, scans, users or settings changed.
  kUpdate,    ///< Ask Update().
};

/// Threads beside the loop, for what may take its time.
enum class Aside {
  kReads,  ///< Lists, and files that are opened.
  kFiles,  ///< Writing and removing large files.
};

/// Of a report; more in `daemon/appliance/report_words.hpp`.
enum class Language { kEnglish, kSpanish };

/// The appliance as the page sees it.
///
/// Every function is called on the loop thread and returns within a few milliseconds: reads answer
/// from memory or from an index, changes may finish later. Those marked (aside) read lists: they
/// are called within Later(), as the others beside them may be. Each change and its audit entry are
/// one transaction of the store. Nothing throws but std::bad_alloc: what goes wrong is a Change.
/// Strings that come in are valid UTF-8, short, and without control characters, but their meaning
/// is not checked.
class ScanService {
 public:
  virtual ~ScanService() = default;

  /// Has `work` done beside the loop, one after the other of its kind, then calls `done` on the
  /// loop. Neither may throw. Within `work` the functions marked (aside), FindPatient(),
  /// FindReference() and FindScan() may be called.
  /// @return False where too much waits already: neither is called then.
  [[nodiscard]] virtual bool Later(Aside where, std::function<void()> work,
                                   std::function<void()> done) = 0;

  // --- what the appliance does
  [[nodiscard]] virtual Status GetStatus() = 0;
  [[nodiscard]] virtual Health GetHealth() = 0;
  /// The newest camera picture as a small JPEG (at most 320 pixels wide, at most 5 a second); null
  /// when the sensor shows none.
  [[nodiscard]] virtual std::shared_ptr<const std::string> Preview() = 0;
  /// As a short press of the button: starts a scan, ends the sweep, leaves a result. kConflict
  /// where it is ignored.
  virtual void Press(const Actor& actor, Done done) = 0;
  /// The same for one purpose each, so that asked twice it does not do the other: kConflict in
  /// other states.
  virtual void StartSweep(const Actor& actor, Done done) = 0;
  virtual void EndSweep(const Actor& actor, Done done) = 0;
  /// As a long press: the scan is thrown away.
  virtual void Cancel(const Actor& actor, Done done) = 0;
  /// Called on the loop thread. One listener; an empty function ends it.
  virtual void SetListener(std::function<void(EventKind)> listener) = 0;

  // --- patients
  [[nodiscard]] virtual std::vector<Patient> Patients() = 0;  ///< By code; at most 1000 (aside).
  [[nodiscard]] virtual std::optional<Patient> FindPatient(const std::string& id) = 0;
  virtual void AddPatient(const Actor& actor, const std::string& code, const std::string& site,
                          Done done) = 0;  ///< Gives the id.
  /// Removes the patient with scans, references and files ("wipe patient"); the audit log keeps
  virtual void ChangePatient(const Actor& actor, const std::string& id, const std::string& site,
                             const std::string& note, Done done) = 0;
  /// Out of the list, or back into it. kConflict while a session of the patient is open.
  virtual void ArchivePatient(const Actor& actor, const std::string& id, bool archived,
                              Done done) = 0;
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

  // --- references
  [[nodiscard]] virtual std::vector<Reference> References(
      const std::string& patient_id) = 0;  ///< Newest version first (aside).
  [[nodiscard]] virtual std::optional<Reference> FindReference(const std::string& id) = 0;
  /// A draft made of a scan with a scene. Gives the id.
  virtual void AddReference(const Actor& actor, const std::string& scan_id,
                            const std::string& reason, Done done) = 0;
  /// Of a draft: changed in place. Of an approved one: a new draft with the next version; gives its
  /// id.
  /// @param revision  That was read: kConflict if another has been saved since.
  virtual void PlanReference(const Actor& actor, const std::string& id, int revision,
                             const ReferencePlan& plan, Done done) = 0;
  /// kRefused for the user who made or last planned it. From then on it is immutable and the one
  /// that fractions are compared with.
  /// @param revision  That was read, as above.
  /// @param digest    Of what was read and is signed; kConflict where it is not what is stored.
  ///                  Empty: the revision alone.
  virtual void ApproveReference(const Actor& actor, const std::string& id, int revision,
                                const std::string& digest, Done done) = 0;

  // --- scans
  /// Newest first; all patients: "" (aside).
  [[nodiscard]] virtual std::vector<Scan> Scans(const std::string& patient_id, int limit) = 0;
  [[nodiscard]] virtual std::optional<Scan> FindScan(const std::string& id) = 0;
  /// kConflict for one without an answer, an old one (2 minutes), one with a newer scan of the same
  /// patient, and while a scan runs.
  /// @param reason  Empty: only a result in tolerance can be accepted. Else one outside tolerance
  ///                is accepted, for this reason.
  virtual void AcceptScan(const Actor& actor, const std::string& id, const std::string& reason,
                          Done done) = 0;
  /// Removes the scan with its files, for a reason that the log keeps. kConflict for one that a
  /// reference is made of, that runs, and while a backup is made.
  virtual void RemoveScan(const Actor& actor, const std::string& id, const std::string& reason,
                          Done done) = 0;

  /// A map of a scan in few bytes (daemon/files/compact_map.hpp); nothing where there is none
  /// (aside). @param name  "heightmap", "deviation", "deviation_after" or "region".
  [[nodiscard]] virtual std::optional<std::string> CompactMap(const std::string& scan_id,
                                                              const std::string& name) = 0;

  /// One page about a scan, or the course of a patient, as a PDF file; nothing where there is no
  /// such scan or patient, or the report cannot be drawn (aside).
  [[nodiscard]] virtual std::optional<std::string> ScanReport(const std::string& scan_id,
                                                              Language language) = 0;
  [[nodiscard]] virtual std::optional<std::string> CourseReport(const std::string& patient_id,
                                                                Language language) = 0;

  // --- daily check
  [[nodiscard]] virtual CheckStatus GetChecks() = 0;  ///< (aside)
  /// The next scan, from any button, is of the room's markers. kConflict during a scan.
  virtual void OpenCheck(const Actor& actor, Done done) = 0;
  /// From now on checks are compared with this one. kRefused for the person who took it.
  virtual void SetCheckBaseline(const Actor& actor, const std::string& check_id, Done done) = 0;

  // --- what is known of the sensor unit
  [[nodiscard]] virtual SensorProfiles GetSensorProfiles() = 0;  ///< (aside)
  /// One version as `plumb calibrate` writes it; nothing where there is none (aside).
  [[nodiscard]] virtual std::optional<std::string> SensorProfileFile(int version) = 0;
  /// The unit begins again from its stated calibration. @param serial  Of the unit that the person
  /// has seen; kConflict where another one is connected by now, and during a scan.
  virtual void ResetSensorProfile(const Actor& actor, const std::string& serial, Done done) = 0;
  /// Takes an earlier version back, as the newest. kNotFound where it holds no profile.
  virtual void RollBackSensorProfile(const Actor& actor, const std::string& serial, int version,
                                     Done done) = 0;

  // --- screens in the room
  [[nodiscard]] virtual std::vector<Display> Displays() = 0;
  virtual void AddDisplay(const Actor& actor, const Display& display, Done done) = 0;
  virtual void RemoveDisplay(const Actor& actor, const std::string& id, Done done) = 0;

  // --- accounts, log, settings
  [[nodiscard]] virtual std::vector<User> Users() = 0;  ///< By name.
  [[nodiscard]] virtual std::optional<User> FindUser(const std::string& name) = 0;
  virtual void AddUser(const Actor& actor, const User& user,
                       Done done) = 0;  ///< kConflict if the name is taken.
  /// kConflict if no enabled engineer would be left, or the account is not as expected.
  virtual void ChangeUser(const Actor& actor, const UserChange& change, Done done) = 0;
  /// Logins and what else is no change of the store. May be written later, in order.
  virtual void Log(const Actor& actor, const std::string& action, const std::string& subject,
                   const std::string& detail) = 0;
  /// Newest first, older than number `before` (0: all) (aside).
  [[nodiscard]] virtual std::vector<AuditEntry> Audit(std::int64_t before, int limit) = 0;
  [[nodiscard]] virtual std::vector<PlanTemplate> Templates() = 0;  ///< By site.
  /// In place of the one of that site; at most 100 sites.
  virtual void SetTemplate(const Actor& actor, const PlanTemplate& wanted, Done done) = 0;
  virtual void RemoveTemplate(const Actor& actor, const std::string& site, Done done) = 0;
  [[nodiscard]] virtual Settings GetSettings() = 0;
  virtual void ChangeSettings(const Actor& actor, const Settings& settings,
                              Done done) = 0;  ///< kInvalid names the field.

  // --- care
  [[nodiscard]] virtual UpdateStatus GetUpdate() = 0;
  /// Checks a file's form and takes it among the bundles under that name (NAME.raucb). Moves the
  /// file. kInvalid: no bundle.
  virtual void AddBundle(const Actor& actor, const std::filesystem::path& file,
                         const std::string& name, Done done) = 0;
  virtual void RemoveBundle(const Actor& actor, const std::string& name, Done done) = 0;
  virtual void InstallUpdate(const Actor& actor, const std::string& bundle,
                             Done done) = 0;  ///< kConflict during a scan.
  /// Restarts the machine. kConflict during a treatment session, a scan and an installation.
  virtual void RestartSystem(const Actor& actor, Done done) = 0;
  /// A roll-back is not told of any more.
  virtual void ForgetRollBack(const Actor& actor, Done done) = 0;
  /// In the configured folder, while scans go on; answers when it is done. kInvalid where no folder
  /// is configured. The message names what was not as it was stored.
  virtual void MakeBackup(const Actor& actor, Done done) = 0;
  /// Gives a file (no patient data in it) that is downloaded once and then removed.
  virtual void WriteDiagnostics(const Actor& actor, Done done) = 0;
};

}  // namespace plumb::web
