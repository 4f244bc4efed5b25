// SPDX-License-Identifier: Apache-2.0
// The appliance without a sensor, for tests of the web: everything in memory, a scan goes as its
// Tick() goes.
#pragma once

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <semaphore>
#include <string>
#include <vector>

#include "web/service/result_terms.hpp"
#include "web/service/services.hpp"

namespace plumb::test {

/// Follows the rules that the services state. One thread.
class FakeAppliance : public web::BackgroundWork,
                      public web::ApplianceService,
                      public web::PatientService,
                      public web::ReferenceService,
                      public web::PlanningService,
                      public web::ScanService,
                      public web::MonitoringService,
                      public web::CheckService,
                      public web::RoomCalibrationService,
                      public web::SensorProfileService,
                      public web::DisplayService,
                      public web::AccountService,
                      public web::AuditLog,
                      public web::SettingsService,
                      public web::UpdateService,
                      public web::MaintenanceService {
 public:
  FakeAppliance();

  /// All of them are this object.
  [[nodiscard]] web::Services services() {
    return {*this, *this, *this, *this, *this, *this, *this, *this,
            *this, *this, *this, *this, *this, *this, *this, *this};
  }

  // --- what tests turn
  Status status;
  Health health;
  Settings settings;
  UpdateStatus update;
  std::vector<Patient> patients;
  std::vector<Reference> references;
  std::optional<RoomOnMap> room_of_references;  ///< Not set: as the status states it.
  std::vector<Scan> scans;                      ///< Oldest first.
  CheckStatus checks;
  SensorProfiles profiles;
  SensorRepeats repeats;  ///< Its sweeps are those without a patient that are not judged yet.
  web::RoomCalibrationStatus room;
  bool is_board_there = false;            ///< Check scans see the board of the room's calibration.
  std::optional<CheckRecord> next_check;  ///< What the next check scan finds; nothing: it passes.
  /// Reads a map of a scan's folder; none: there are no maps.
  std::function<std::optional<std::string>(const std::filesystem::path&, const std::string&)>
      make_map;
  std::vector<Display> displays;
  std::vector<User> users;
  Message accounts_fault;         ///< Why none of them can be looked up; empty: they can.
  std::vector<AuditEntry> audit;  ///< Oldest first.
  std::string ExportAudit() override { return "{\"number\":1}\n"; }
  std::shared_ptr<const std::string> preview, surface;
  std::optional<CameraOutline> outline;
  std::filesystem::path diagnostics_file;
  std::uint64_t uploaded_bytes = 0;
  std::optional<FactoryReset> factory_reset;  ///< Asked for.
  std::vector<std::string> stick = {"plumb-0.4.0.raucb"};
  int num_restarts = 0;  ///< Asked for and done; a fake machine stays on.
  /// Folder of the n-th finished scan (0, 1, ...) with its result; a scan beyond the list uses the
  /// last.
  struct Recorded {
    std::filesystem::path folder;
    std::optional<ResultSummary> result;
  };
  std::vector<std::function<Recorded()>> recorded;
  bool encrypts_backups = false;
  std::string backup_fault;               ///< Why no backup can be made; empty: one can.
  std::optional<Recorded> next_recorded;  ///< Set: what the next finished scan shows, out of turn.
  std::chrono::milliseconds sweep{3000};
  std::chrono::milliseconds work{600};
  double swept = 0.0;                   ///< Share of the running sweep.
  std::optional<SweepAdvice> guidance;  ///< Set: what every sweep advises.
  /// Set: completions wait here until the test calls them.
  bool hold_completions = false;
  std::vector<std::function<void()>> held;

  /// If set, background work waits here until the test runs it: the work, then what follows
  /// on the loop.
  bool hold_background_work = false;
  std::vector<std::function<void()>> held_background_work;
  /// Of this kind only; the other kind is done at once.
  std::optional<web::BackgroundPool> hold_only;
  bool refuse_background_work = false;  ///< Too much waits already.
  int num_refused_background_work = 0;
  /// Released for each work that waits here or is refused.
  std::counting_semaphore<> asked_for_background_work{0};

  /// Moves a running scan on. @param now  Any clock that grows.
  void Tick(std::chrono::steady_clock::time_point now);
  void Notify(web::EventKind kind) const;
  /// The running scan, or none, fails as one of plumbd does: a press acknowledges.
  void Fail(const std::string& reason);
  /// A check scan that saw the board of the room's calibration.
  void SeeBoard(const CheckRecord& check);
  void Unplug();
  void Plug();

  // --- the services
  bool RunInBackground(web::BackgroundPool where, std::function<void()> work,
                       std::function<void()> done) override;
  /// With the age of the last result, unless a test has set one.
  Status GetStatus() override;
  Health GetHealth() override { return health; }
  std::shared_ptr<const std::string> Preview() override { return preview; }
  std::function<std::string()> Photographer() override {
    if (!preview) return {};
    return [picture = preview] { return *picture; };
  }
  std::optional<CameraOutline> Outline() override { return outline; }
  std::shared_ptr<const std::string> SweptSurface() override {
    return status.state == ApplianceState::kScanning ? surface : nullptr;
  }
  void Press(const Actor& actor, Done done) override;
  void StartSweep(const Actor& actor, Done done) override;
  void EndSweep(const Actor& actor, Done done) override;
  void Cancel(const Actor& actor, Done done) override;
  MonitorStatus GetMonitor() override { return monitor; }
  std::shared_ptr<const std::string> MonitorMap() override { return monitor_map; }
  void StartMonitor(const Actor& actor, Done done) override;
  void StopMonitor(const Actor& actor, Done done) override;
  void AcceptLive(const Actor& actor, const std::string& reason, Done done) override;
  void TeachBreath(const Actor& actor, Done done) override;
  void ForgetBreath(const Actor& actor, Done done) override;
  nlohmann::json MonitorRecords(const std::string& scan_id) override;
  nlohmann::ordered_json MonitorReport(const std::string& scan_id, int number) override {
    return number == 1 && scan_id == monitored_scan ? monitor_report : nlohmann::ordered_json();
  }
  std::string MonitorCsv(const std::string& scan_id, int number) override {
    const bool is_there =
        number == 0 ? monitor.has_record : number == 1 && scan_id == monitored_scan;
    return is_there ? "time_s,state,advice\n" : std::string();
  }
  std::shared_ptr<const std::string> monitor_map;
  MonitorStatus monitor;
  std::string monitored_scan;             ///< That has one record.
  nlohmann::ordered_json monitor_report;  ///< Of that.
  void SetListener(std::function<void(web::EventKind)> listener) override {
    listener_ = std::move(listener);
  }
  std::vector<Patient> Patients() override { return patients; }
  std::optional<Patient> FindPatient(const std::string& id) override;
  void AddPatient(const Actor& actor, const std::string& code, const std::string& site,
                  Done done) override;
  /// No check has passed today; `block` as in Status::reference_block. Empty: one has.
  void SetOverdue(const Message& block) {
    checks.today = status.daily_check = block.empty() ? DailyCheck::kPassed : DailyCheck::kOverdue;
    status.reference_block = block;
    Notify(web::EventKind::kStatus);
  }
  std::vector<PlanTemplate> templates;
  [[nodiscard]] std::vector<PlanTemplate> Templates() override { return templates; }
  void SetTemplate(const Actor& actor, const PlanTemplate& wanted, Done done) override;
  void RemoveTemplate(const Actor& actor, const std::string& site, Done done) override;
  void ChangePatient(const Actor& actor, const std::string& id, const CourseNotes& wanted,
                     const std::optional<CourseNotes>& shown, Done done) override;
  std::optional<std::string> Photo(const std::string& id) override {
    const auto found = photos_.find(id);
    return found == photos_.end() ? std::nullopt : std::optional(found->second);
  }
  void SetPhoto(const Actor& actor, const std::string& id, std::function<std::string()> take,
                Done done) override;
  std::vector<DrawnPoint> Drawing(const std::string& id) override { return drawings_[id]; }
  void SetDrawing(const Actor& actor, const std::string& id, const std::vector<DrawnPoint>& points,
                  int revision, Done done) override;
  void ArchivePatient(const Actor& actor, const std::string& id, bool archived, Done done) override;
  void WipePatient(const Actor& actor, const std::string& id, Done done) override;
  void OpenPatient(const Actor& actor, const std::string& id, ScanPurpose purpose,
                   const std::string& reason, const std::string& replaces, Done done) override;
  void ResumeSession(const Actor& actor, const std::string& session_id, const std::string& replaces,
                     Done done) override;
  void ConfirmWristband(const Actor& actor, const std::string& session_id, const std::string& code,
                        Done done) override;
  void CorrectFraction(const Actor& actor, const std::string& session_id, int fraction,
                       const std::string& reason, Done done) override;
  void UseReference(const Actor& actor, const std::string& session_id,
                    const std::string& reference_id, Done done) override;
  void CloseSession(const Actor& actor, const std::string& session_id, Done done) override;
  std::vector<Reference> References(const std::string& patient_id) override;
  std::optional<Reference> FindReference(const std::string& id) override;
  RoomOnMap RoomOfReference(const Reference& reference) override;
  void AddReference(const Actor& actor, const std::string& scan_id, const std::string& reason,
                    Done done) override;
  /// A draft of a scan whose folder `import_planning` makes, which may refuse the files.
  void AddPlanning(const Actor& actor, const std::string& patient_id, const web::SentPlanning& sent,
                   Done done) override;
  std::function<std::filesystem::path(const web::SentPlanning&)> import_planning;
  web::SentPlanning sent_planning;  ///< The last one.
  /// Threshold of the CT images that a scan's scene was made of; nothing: it was not.
  std::function<std::optional<double>(const Scan&)> skin_of_images;
  Received received;
  TodaysWorklist worklist;
  Received GetReceived() override { return received; }
  /// As an upload of these files, each named as in `received`.
  void ImportReceived(const Actor& actor, const std::string& patient_id,
                      const web::ReceivedChoice& choice, Done done) override;
  TodaysWorklist GetWorklist() override { return worklist; }
  Message planning_doubt;  ///< Why the files may be another patient's; empty: they are not.
  void PlanReference(const Actor& actor, const std::string& id, int revision,
                     const ReferencePlan& plan, Done done) override;
  /// Cautions are asked for where a test judges the quality.
  void ApproveReference(const Actor& actor, const std::string& id, int revision,
                        const std::string& digest, const web::Considered& considered,
                        Done done) override;
  std::vector<Scan> Scans(const std::string& patient_id, int limit) override;
  std::optional<Scan> FindScan(const std::string& id) override;
  void RemoveScan(const Actor& actor, const std::string& id, const std::string& reason,
                  Done done) override;
  void MakeBackup(const Actor& actor, Done done) override;
  void NoteBackupVerified(const Actor& actor, Done done) override {
    Did(actor, "backup.verify", "", done);
  }
  void AcceptScan(const Actor& actor, const std::string& id, const std::string& reason,
                  Done done) override;
  std::optional<std::string> CompactMap(const std::string& scan_id,
                                        const std::string& name) override {
    const auto scan = FindScan(scan_id);
    return scan && make_map ? make_map(scan->folder, name) : std::nullopt;
  }
  web::ScanQuality QualityOf(const std::string& scan_id) override {
    const auto scan = FindScan(scan_id);
    if (scan && judge_quality) return judge_quality(*scan);
    web::ScanQuality quality;
    const Message caution = web::DailyCheckCaution(scan ? scan->daily_check : DailyCheck::kPassed);
    if (!caution.empty()) quality.cautions.push_back(caution);
    return quality;
  }
  std::function<web::ScanQuality(const Scan&)> judge_quality;  ///< As the real one does, if set.
  std::optional<std::string> PictureOf(const std::string&, web::ComparisonPicture picture,
                                       const Catalogue& language) override {
    if (!draws_pictures) return std::nullopt;
    return std::string(picture == web::ComparisonPicture::kOverlay ? "overlay" : "error map") +
           " in " + std::string(language.name);
  }
  bool draws_pictures = false;
  bool is_unreadable = false;  ///< Signed acts on references throw, as those of the real store.
  std::optional<std::string> ScanReport(const std::string& scan_id,
                                        const Catalogue& language) override {
    report_language = language.code;
    return FindScan(scan_id) ? std::optional<std::string>("%PDF-1.5 a scan") : std::nullopt;
  }
  std::optional<std::string> CourseReport(const std::string& patient_id,
                                          const Catalogue& language) override {
    report_language = language.code;
    return FindPatient(patient_id) ? std::optional<std::string>("%PDF-1.5 a course") : std::nullopt;
  }
  std::string report_language = "en";  ///< Of the last report.
  CheckStatus GetChecks() override { return checks; }
  void OpenCheck(const Actor& actor, Done done) override;
  void LeaveCheck(const Actor& actor, Done done) override;
  void SetCheckBaseline(const Actor& actor, const std::string& check_id, const std::string& reason,
                        Done done) override;
  web::RoomCalibrationStatus GetRoomCalibration() override { return room; }
  void SignRoomCalibration(const Actor& actor, const std::string& digest, Done done) override;
  void SignCouch(const Actor& actor, const CouchProfile& couch, Done done) override;
  std::optional<std::string> RoomBoardPdf(Message& why_not) override;
  SensorProfiles GetSensorProfiles() override { return profiles; }
  std::optional<std::string> SensorProfileFile(int version) override;
  SensorRepeats GetSensorRepeats() override;
  void JudgeSensorRepeats(const Actor& actor, const std::string& serial, Done done) override;
  void ResetSensorProfile(const Actor& actor, const std::string& serial, Done done) override;
  void RollBackSensorProfile(const Actor& actor, const std::string& serial, int version,
                             Done done) override;
  std::vector<Display> Displays() override { return displays; }
  void AddDisplay(const Actor& actor, const Display& display, Done done) override;
  void RemoveDisplay(const Actor& actor, const std::string& id, Done done) override;
  Message WhyUnreadable() override { return accounts_fault; }
  std::vector<User> Users() override { return users; }
  std::optional<User> FindUser(const std::string& name) override;
  void AddUser(const Actor& actor, const User& user, Done done) override;
  void ChangeUser(const Actor& actor, const UserChange& change, Done done) override;
  std::map<std::string, SecondFactor> second_factors;
  std::optional<SecondFactor> FindSecondFactor(const std::string& name) override {
    const auto found = second_factors.find(name);
    return found == second_factors.end() ? std::nullopt : std::optional(found->second);
  }
  void SetSecondFactor(const Actor& actor, const std::string& name,
                       const std::optional<SecondFactor>& expected,
                       const std::optional<SecondFactor>& wanted, const std::string& action,
                       Done done) override;
  std::map<std::string, std::string> pins;
  std::optional<std::string> FindPin(const std::string& name) override {
    const auto found = pins.find(name);
    return found == pins.end() ? std::nullopt : std::optional(found->second);
  }
  void SetPin(const Actor& actor, const std::string& name, const std::optional<std::string>& hash,
              Done done) override;
  Preferences PreferencesOf(const std::string& name) override { return preferences_[name]; }
  void SetPreferences(const Actor& actor, const Preferences& preferences, Done done) override;
  void Log(const Actor& actor, const std::string& action, const std::string& subject,
           const Message& detail) override;
  std::vector<AuditEntry> Audit(const AuditQuery& query) override;
  Settings GetSettings() override { return settings; }
  void ChangeSettings(const Actor& actor, const SettingsChange& change, Done done) override;
  UpdateStatus GetUpdate() override { return update; }
  void AddBundle(const Actor& actor, const std::filesystem::path& file, const std::string& name,
                 Done done) override;
  void RemoveBundle(const Actor& actor, const std::string& name, Done done) override;
  void InstallUpdate(const Actor& actor, const std::string& bundle, Done done) override;
  [[nodiscard]] std::vector<std::string> StickBundles() override { return stick; }
  void InstallFromStick(const Actor& actor, const std::string& bundle, Done done) override;
  void RestartSystem(const Actor& actor, Done done) override;
  void ResetToFactory(const Actor& actor, FactoryReset kind, Done done) override;
  void ForgetRollBack(const Actor& actor, Done done) override;
  void WriteDiagnostics(const Actor& actor, Done done) override;
  void SendTestMessage(const Actor& actor, Done done) override;

  /// A reference made of a scan, as AddReference() does it, without the log.
  Reference& MakeReference(const Scan& scan, const std::string& by, const std::string& reason);

 private:
  /// As the store describes it; sessions are remembered, all else is looked up.
  [[nodiscard]] std::optional<AuditSubject> SubjectOf(const AuditEntry& entry);
  void Finish(const Done& done, Change change);
  void Did(const Actor& actor, const std::string& action, const std::string& subject,
           const Done& done, const std::string& id = "");
  void EndScan();
  void TellWaiting();
  void TellNewerReference();
  std::string chosen_at_reference_;  ///< The newest one when a person chose another.
  void EndSession();
  [[nodiscard]] bool IsOld(const Scan& scan) const;
  void EndCheck();
  void CloseCheck();
  [[nodiscard]] bool WantsWristband() const;
  [[nodiscard]] Patient* PatientOf(const std::string& id);

  std::function<void(web::EventKind)> listener_;
  std::optional<std::chrono::steady_clock::time_point> phase_begun_;
  std::size_t num_finished_ = 0;
  bool is_check_ = false;     ///< The next or running scan is a check.
  std::string judged_to_;     ///< The newest sweep by which the sensor was judged.
  std::string wristband_of_;  ///< The session for whose next sweep it has been scanned.
  std::string checker_, patient_before_check_;
  int next_id_ = 1;
  std::map<std::string, Preferences> preferences_;
  std::map<std::string, int> num_fractions_;
  std::map<std::string, std::string> photos_;
  std::map<std::string, std::vector<DrawnPoint>> drawings_;
  std::map<std::string, TreatmentSession> sessions_;  ///< By id: all that were opened.
};

}  // namespace plumb::test
