// What the appliance keeps: patients, references, scans, results, accounts, the audit log. SQLite
// beside folders of files.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/records/backup.hpp"
#include "daemon/records/database.hpp"
#include "daemon/records/room_calibration.hpp"
#include "daemon/records/scan_files.hpp"
#include "web/service/audit_log.hpp"
#include "web/service/change.hpp"
#include "web/service/service_types.hpp"

namespace plumb {

/// A change that the store does not make, and why; for the person who asked.
class StoreRefusal : public std::runtime_error {
 public:
  StoreRefusal(web::ChangeResult result, const std::string& message)
      : std::runtime_error(message), result_(result) {}
  [[nodiscard]] web::ChangeResult result() const { return result_; }

 private:
  web::ChangeResult result_;
};

/// Most of the stored scans cannot be seen: supposedly their disk is not mounted. Nothing was
/// changed.
class ScansMissing : public DiskRefused {
 public:
  using DiskRefused::DiskRefused;
};

/// What a start found after a crash, and put right. Each step is in the audit log too.
struct RecoveryReport {
  int interrupted_scans = 0;  ///< Had begun and not ended: failed now.
  int orphaned_folders = 0;   ///< Staging, or of scans that failed or were removed: removed.
  int foreign_folders = 0;    ///< Of scans that no row knows to have ended: moved to DIR/set-aside.
  int lost_scans = 0;         ///< Finished, but their files cannot be seen now: unavailable.
  int attached_scans = 0;     ///< Were unavailable, and their files are there again.
  int broken_references = 0;  ///< Approved, but their scene cannot be seen: to be told loudly.
  bool checked_database = true;  ///< False: there was not time to look at all of it.
};

/// Held on a folder while one store has it, against another process's.
class FolderLock {
 public:
  FolderLock() = default;
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;
  /// @throws DatabaseBusy if another has it.
  void Take(const std::filesystem::path& folder);

 private:
  int fd_ = -1;
};

struct StoreOptions {
  LookAtPath look = LookAt;
  /// A database that another process holds is asked for again until then; a copying program lets
  /// go of it.
  std::chrono::milliseconds lock_wait = std::chrono::minutes(1);
  std::chrono::milliseconds busy_wait = std::chrono::seconds(5);  ///< Within each of these.
  std::function<void(std::chrono::milliseconds)> sleep = {};      ///< Empty: the thread's.
  /// The database is looked at for so long before the start goes on.
  std::chrono::milliseconds check_limit = std::chrono::seconds(20);
};

/// What a scan begins with.
struct NewScan {
  std::string patient_id;
  std::string reference_id;  ///< Empty: none.
  web::ScanPurpose purpose = web::ScanPurpose::kFraction;
  std::string sensor_serial;
  std::string reason;           ///< Why a new reference is taken.
  std::string session_id = {};  ///< Empty: none is open.
  std::optional<double> sensor_on_s = {};
  bool check_overdue = false;
};

/// How it ended.
struct FinishedScan {
  web::ScanOutcome outcome = web::ScanOutcome::kFailed;
  std::string failure;
  std::string result_json;  ///< Empty: nothing was compared.
  double swept_area_m2 = 0.0;
};

/// DIR/plumb.db and DIR/scans/ID/. A scan's files are made in a hidden staging folder and appear
/// under their id in one step; its row says `done` only after that, so a crash at any point leaves
/// either a whole scan or none. Changes and their audit entries are one transaction.
///
/// Thread-safe: changes take turns; reads of single rows and lists have a connection each: they
/// never wait for the disk writes of a change, nor a row for a list. Changes throw StoreRefusal,
/// and IoError with its kinds when the disk or the database fails.
class Store {
 public:
  /// Opens or makes the store, checks and migrates the database, recovers from a crash.
  /// @throws IoError and its kinds: DatabaseCorrupt, DiskRefused.
  explicit Store(const std::filesystem::path& folder, StoreOptions options = {});
  /// What can be read of a store on a disk that cannot be written: nothing is checked, put right or
  /// changed; every change throws DiskRefused.
  /// @throws IoError and its kinds.
  [[nodiscard]] static std::unique_ptr<Store> OpenReadable(const std::filesystem::path& folder);
  /// Tries to write beside the database. @throws DiskRefused saying why that fails, unless the disk
  /// is only full.
  void CheckWritable() const;

  [[nodiscard]] const RecoveryReport& recovery() const { return recovery_; }
  [[nodiscard]] std::filesystem::path ScanFolder(const std::string& scan_id) const;

  // --- patients
  [[nodiscard]] std::vector<web::Patient> Patients();
  [[nodiscard]] std::optional<web::Patient> FindPatient(const std::string& id);
  [[nodiscard]] std::optional<web::Patient> FindPatientByCode(const std::string& code);
  std::string AddPatient(const web::Actor& actor, const std::string& code, const std::string& site);
  void ChangePatient(const web::Actor& actor, const std::string& id, const std::string& site,
                     const std::string& note);
  /// kConflict while a session of the patient is open.
  void ArchivePatient(const web::Actor& actor, const std::string& id, bool archived);
  void WipePatient(const web::Actor& actor, const std::string& id);

  // --- treatment sessions, screens in the room
  /// Ends the one that is open, if any. Gives the id.
  std::string OpenSession(const web::Actor& actor, const std::string& patient_id,
                          web::ScanPurpose purpose);
  /// All that are open.
  void CloseSessions(const web::Actor& actor);
  [[nodiscard]] std::optional<web::TreatmentSession> OpenedSession();
  [[nodiscard]] std::vector<web::Display> Displays();
  std::string AddDisplay(const web::Actor& actor, const web::Display& display);
  void RemoveDisplay(const web::Actor& actor, const std::string& id);

  // --- references
  /// Drafts that are newer than the approved version of their patient; at most 20.
  [[nodiscard]] std::vector<web::WaitingReference> WaitingReferences();
  [[nodiscard]] std::vector<web::Reference> References(const std::string& patient_id);
  [[nodiscard]] std::optional<web::Reference> FindReference(const std::string& id);
  [[nodiscard]] std::optional<web::Reference> ApprovedReference(const std::string& patient_id);
  std::string AddReference(const web::Actor& actor, const std::string& scan_id,
                           const std::string& reason, const web::ReferencePlan& plan);
  /// @param revision  That was read; another one has been saved since: kConflict.
  std::string PlanReference(const web::Actor& actor, const std::string& id, int revision,
                            const web::ReferencePlan& plan);
  /// @param digest  Of what was read and is signed; another one is stored: kConflict. Empty: not
  /// looked at.
  /// @param two_users  The approver must be another than who made or planned it; false only for the
  /// demo's "auto".
  void ApproveReference(const web::Actor& actor, const std::string& id, int revision,
                        const std::string& digest = {}, bool two_users = true);

  [[nodiscard]] std::vector<web::PlanTemplate> Templates();  ///< By site.
  /// In place of the one of that site. kConflict above 100 sites.
  void SetTemplate(const web::Actor& actor, const web::PlanTemplate& wanted);
  void RemoveTemplate(const web::Actor& actor, const std::string& site);

  // --- scans
  [[nodiscard]] std::vector<web::Scan> Scans(const std::string& patient_id, int limit);
  [[nodiscard]] std::optional<web::Scan> FindScan(const std::string& id);
  [[nodiscard]] int ScansSince(const std::string& patient_id, web::WallClock::time_point since);
  /// Surface seen by a scan's sweep; 0 unknown.
  [[nodiscard]] double SweptArea(const std::string& scan_id);
  /// A row that says `running`, and an empty staging folder. Gives the id.
  std::string BeginScan(const NewScan& scan);
  [[nodiscard]] std::filesystem::path StagingFolder(const std::string& scan_id) const;
  /// kDone: the staging folder becomes the scan's. kFailed: only the recording in it, where it is
  /// complete. Else it is removed.
  void FinishScan(const std::string& scan_id, const FinishedScan& finished);
  /// Verdict, numbers and reason go into the log. kConflict where a newer scan of the patient is
  /// done or runs, and for a result that is not in tolerance without a reason.
  void AcceptScan(const web::Actor& actor, const std::string& id, const std::string& reason = {});
  /// kConflict for a scan that references are made of, that runs, and while a backup is made;
  /// kInvalid without a reason.
  void RemoveScan(const web::Actor& actor, const std::string& id, const std::string& reason);
  /// Removes scans older than so many days (0: none) but those that references are made of. Gives
  /// how many. Their age is by the wall clock: call it while that can be trusted.
  int RemoveOldScans(int retention_days, const std::stop_token& stop = {});
  /// Removes the oldest recordings, then the oldest scans as above, until the scans take at most so
  /// many bytes. Gives how many scans lost something.
  int KeepWithinQuota(std::uint64_t max_bytes, const std::stop_token& stop = {});

  // --- integrity
  /// Why the files of a scan cannot be used, by their SHA-256: "scene/cloud.ply has been changed
  /// ...". Empty: they are what was stored. Files that have no digest yet get one ("first seen").
  /// Changes the scan's row and the log where that is news. @throws IoError; Interrupted
  /// @param scene_only  Only what a comparison reads.
  [[nodiscard]] std::string CheckFiles(const std::string& scan_id, bool scene_only,
                                       const std::stop_token& stop = {});
  /// The same for the scan that was not checked for longest, if that is longer ago than
  /// `at_least`. Gives its id and what is wrong; nothing if none is due.
  struct CheckedScan {
    std::string id, fault;
  };
  std::optional<CheckedScan> CheckNextScan(std::chrono::hours at_least,
                                           const std::stop_token& stop = {});

  // --- backup
  /// While scans go on; nothing is removed meanwhile. See backup.hpp. @throws StoreRefusal where
  /// one is being made already; IoError; Interrupted
  BackupReport Backup(const web::Actor& actor, const std::filesystem::path& target,
                      const std::stop_token& stop = {}, const BackupSecret* secret = nullptr);

  // --- daily check
  /// @param check_json  Of CheckJson(). Gives the id.
  std::string AddCheck(const web::Actor& actor, const std::string& sensor_serial,
                       const std::string& check_json);
  [[nodiscard]] std::vector<web::CheckRecord> Checks(int limit);  ///< Newest first.
  [[nodiscard]] std::optional<web::CheckRecord> LastCheck();
  /// Not in the future. @param sensor_serial  Of the unit that is to be checked; empty: any.
  [[nodiscard]] bool HasPassedCheckSince(web::WallClock::time_point since,
                                         const std::string& sensor_serial = {});
  /// Whether a check shows after the fact that sensor and markers were right at this scan: of the
  /// same unit, passed on the day of the scan and after it, with no failed check in between and
  /// against a baseline from before the scan.
  [[nodiscard]] bool IsConfirmedByLaterCheck(const std::string& scan_id);
  [[nodiscard]] std::optional<web::CheckBaseline> CheckBaseline();
  [[nodiscard]] std::string
  CheckBaselineJson();  ///< Of the check that is the baseline; empty: none.
  void SetCheckBaseline(const web::Actor& actor, const std::string& check_id);

  // --- room calibration
  /// Of the check scans with this sensor since then and since the last signature.
  [[nodiscard]] RoomCandidate CandidateOfRoom(const std::string& sensor_serial,
                                              web::WallClock::time_point since);
  /// The newest one; one that cannot be read is told by DataError. @throws DataError
  [[nodiscard]] std::optional<SignedRoom> RoomCalibration();
  /// Newest first, those that cannot be read left out.
  [[nodiscard]] std::vector<SignedRoom> RoomCalibrations(int limit);
  /// @param digest  Of the candidate that was read; kConflict where it is not what would be stored.
  /// Gives the version.
  std::string SignRoom(const web::Actor& actor, const std::string& sensor_serial,
                       web::WallClock::time_point since, const std::string& digest);
  /// By the newest check since it was signed that saw enough of the room; empty: it is not.
  [[nodiscard]] std::string WhyRoomIsDueNow(const SignedRoom& room,
                                            const MarkerCheckLimits& limits);

  // --- accounts, log, settings
  [[nodiscard]] std::vector<web::User> Users();
  [[nodiscard]] std::optional<web::User> FindUser(const std::string& name);
  void AddUser(const web::Actor& actor, const web::User& user);
  void ChangeUser(const web::Actor& actor, const web::UserChange& change);
  void Log(const web::Actor& actor, const std::string& action, const std::string& subject,
           const std::string& detail);
  [[nodiscard]] std::vector<web::AuditEntry> Audit(const web::AuditQuery& wanted);
  /// Each entry carries the SHA-256 of the one before and of itself. Gives the number of the first
  /// that does not fit; nothing: the log is as it was written. Entries of before schema 5 are
  /// covered together.
  [[nodiscard]] std::optional<std::int64_t> FirstBrokenAuditEntry();
  [[nodiscard]] web::Settings GetSettings();
  void ChangeSettings(const web::Actor& actor, const web::Settings& settings);

 private:
  friend class PatientImport;  ///< Of patient_transfer.cpp.
  Store() = default;
  /// A finished scan and what a look at its files gave.
  struct LookedAt {
    std::int64_t id = 0;
    std::string before, now;  ///< Why its files cannot be used; empty: they can.
    bool is_approved = false;
  };
  void OpenDatabase();
  void Recover();
  void FailInterrupted();
  void RefuseScansOfAnother();
  [[nodiscard]] std::vector<LookedAt> LookAtScans();
  void RefuseIfMostAreMissing(const std::vector<LookedAt>& scans);
  void NoteAvailability(const std::vector<LookedAt>& scans);
  void CollectOrphans();
  void CollectOrphan(const std::filesystem::path& folder);
  void Discard(const std::filesystem::path& folder, const std::string& why);
  void SetAside(const std::filesystem::path& folder, const std::string& name,
                const std::string& why);
  [[nodiscard]] std::vector<std::filesystem::path> ScanFolders()
      const;  ///< Those of numbers, and staging.
  [[nodiscard]] std::vector<FileDigest> StoredDigests(std::int64_t scan);
  void StoreDigests(std::int64_t scan, const std::vector<FileDigest>& files);
  void SetUnavailable(std::int64_t scan, const std::string& before, const std::string& now);
  void CloseOpenSessions(const web::Actor& actor);
  void NoteEnd(const std::string& scan_id, const FinishedScan& finished, bool has_folder,
               const std::vector<FileDigest>& files);
  void Write(const web::Actor& actor, const std::string& action, const std::string& subject,
             const std::string& detail);
  /// Held while files are removed. @throws StoreRefusal while a backup is made.
  [[nodiscard]] std::unique_lock<std::mutex> LockRemovals();
  void NoteRemoved(const std::string& scan_id);
  void RemoveScanFiles(const std::string& scan_id);
  [[nodiscard]] static std::vector<std::string> ScansOf(Statement query);
  void ForgetRecording(const std::string& scan_id);
  bool ForgetScan(const std::string& scan_id);  ///< False if it has become a reference.

  std::filesystem::path folder_;
  FolderLock folder_lock_;
  StoreOptions options_;
  std::mutex write_mutex_;
  std::unique_ptr<Database> write_;
  std::optional<std::int64_t> running_;  ///< Scan that has begun and not ended.
  std::mutex read_mutex_;
  std::unique_ptr<Database> read_;  ///< Single rows, for the loop too.
  std::mutex list_mutex_;
  std::unique_ptr<Database> list_;  ///< Lists, which may take their time.
  std::mutex removal_mutex_;
  std::atomic<bool> backing_up_ = false;
  RecoveryReport recovery_;
};

}  // namespace plumb
