// The appliance without a sensor, for tests of the web: everything in memory, a scan goes as its
// Tick() goes.
#pragma once

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
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
                      public web::ScanService,
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
    return {*this, *this, *this, *this, *this, *this, *this,
            *this, *this, *this, *this, *this, *this, *this};
  }

  // --- what tests turn
  web::Status status;
  web::Health health;
  web::Settings settings;
  web::UpdateStatus update;
  std::vector<web::Patient> patients;
  std::vector<web::Reference> references;
  std::optional<web::RoomOnMap> room_of_references;  ///< Not set: as the status states it.
  std::vector<web::Scan> scans;                      ///< Oldest first.
  web::CheckStatus checks;
  web::SensorProfiles profiles;
  web::RoomCalibrationStatus room;
  bool is_board_there = false;  ///< Check scans see the board of the room's calibration.
  std::optional<web::CheckRecord>
      next_check;  ///< What the next check scan finds; nothing: it passes.
  /// Reads a map of a scan's folder; none: there are no maps.
  std::function<std::optional<std::string>(const std::filesystem::path&, const std::string&)>
      make_map;
  std::vector<web::Display> displays;
  std::vector<web::User> users;
  std::string accounts_fault;          ///< Why none of them can be looked up; empty: they can.
  std::vector<web::AuditEntry> audit;  ///< Oldest first.
  std::string ExportAudit() override { return "{\"number\":1}\n"; }
  std::shared_ptr<const std::string> preview, surface;
  std::filesystem::path diagnostics_file;
  std::uint64_t uploaded_bytes = 0;
  std::optional<web::FactoryReset> factory_reset;  ///< Asked for.
  std::vector<std::string> stick = {"plumb-0.4.0.raucb"};
  int num_restarts = 0;  ///< Asked for and done; a fake machine stays on.
  /// Folder of the n-th finished scan (0, 1, ...) with its result; a scan beyond the list uses the
  /// last.
  struct Recorded {
    std::filesystem::path folder;
    std::optional<web::ResultSummary> result;
  };
  std::vector<std::function<Recorded()>> recorded;
  std::string backup_fault;               ///< Why no backup can be made; empty: one can.
  std::optional<Recorded> next_recorded;  ///< Set: what the next finished scan shows, out of turn.
  std::chrono::milliseconds sweep{3000};
  std::chrono::milliseconds work{600};
  double swept = 0.0;                        ///< Share of the running sweep.
  std::optional<web::SweepAdvice> guidance;  ///< Set: what every sweep advises.
  /// Set: completions wait here until the test calls them.
  bool hold_completions = false;
  std::vector<std::function<void()>> held;

  /// If set, background work waits here until the test runs it: the work, then what follows
  /// on the loop.
  bool hold_background_work = false;
  std::vector<std::function<void()>> held_background_work;
  bool refuse_background_work = false;  ///< Too much waits already.

  /// Moves a running scan on. @param now  Any clock that grows.
  void Tick(std::chrono::steady_clock::time_point now);
  void Notify(web::EventKind kind) const;
  /// The running scan, or none, fails as one of plumbd does: a press acknowledges.
  void Fail(const std::string& reason);
  /// A check scan that saw the board of the room's calibration.
  void SeeBoard(const web::CheckRecord& check);
  void Unplug();
  void Plug();

  // --- the services
  bool RunInBackground(web::BackgroundPool where, std::function<void()> work,
                       std::function<void()> done) override;
  /// With the age of the last result, unless a test has set one.
  web::Status GetStatus() override;
  web::Health GetHealth() override { return health; }
  std::shared_ptr<const std::string> Preview() override { return preview; }
  std::shared_ptr<const std::string> SweptSurface() override {
    return status.state == web::ApplianceState::kScanning ? surface : nullptr;
  }
  void Press(const web::Actor& actor, web::Done done) override;
  void StartSweep(const web::Actor& actor, web::Done done) override;
  void EndSweep(const web::Actor& actor, web::Done done) override;
  void Cancel(const web::Actor& actor, web::Done done) override;
  void SetListener(std::function<void(web::EventKind)> listener) override {
    listener_ = std::move(listener);
  }
  std::vector<web::Patient> Patients() override { return patients; }
  std::optional<web::Patient> FindPatient(const std::string& id) override;
  void AddPatient(const web::Actor& actor, const std::string& code, const std::string& site,
                  web::Done done) override;
  /// No check has passed today; `block` as in Status::reference_block. Empty: one has.
  void SetOverdue(const std::string& block) {
    checks.today = status.daily_check =
        block.empty() ? web::DailyCheck::kPassed : web::DailyCheck::kOverdue;
    status.reference_block = block;
    Notify(web::EventKind::kStatus);
  }
  std::vector<web::PlanTemplate> templates;
  [[nodiscard]] std::vector<web::PlanTemplate> Templates() override { return templates; }
  void SetTemplate(const web::Actor& actor, const web::PlanTemplate& wanted,
                   web::Done done) override;
  void RemoveTemplate(const web::Actor& actor, const std::string& site, web::Done done) override;
  void ChangePatient(const web::Actor& actor, const std::string& id, const web::CourseNotes& wanted,
                     const std::optional<web::CourseNotes>& shown, web::Done done) override;
  void ArchivePatient(const web::Actor& actor, const std::string& id, bool archived,
                      web::Done done) override;
  void WipePatient(const web::Actor& actor, const std::string& id, web::Done done) override;
  void OpenPatient(const web::Actor& actor, const std::string& id, web::ScanPurpose purpose,
                   const std::string& reason, const std::string& replaces, web::Done done) override;
  void CloseSession(const web::Actor& actor, const std::string& session_id,
                    web::Done done) override;
  std::vector<web::Reference> References(const std::string& patient_id) override;
  std::optional<web::Reference> FindReference(const std::string& id) override;
  web::RoomOnMap RoomOfReference(const web::Reference& reference) override;
  void AddReference(const web::Actor& actor, const std::string& scan_id, const std::string& reason,
                    web::Done done) override;
  void PlanReference(const web::Actor& actor, const std::string& id, int revision,
                     const web::ReferencePlan& plan, web::Done done) override;
  void ApproveReference(const web::Actor& actor, const std::string& id, int revision,
                        const std::string& digest, web::Done done) override;
  std::vector<web::Scan> Scans(const std::string& patient_id, int limit) override;
  std::optional<web::Scan> FindScan(const std::string& id) override;
  void RemoveScan(const web::Actor& actor, const std::string& id, const std::string& reason,
                  web::Done done) override;
  void MakeBackup(const web::Actor& actor, web::Done done) override;
  void AcceptScan(const web::Actor& actor, const std::string& id, const std::string& reason,
                  web::Done done) override;
  std::optional<std::string> CompactMap(const std::string& scan_id,
                                        const std::string& name) override {
    const auto scan = FindScan(scan_id);
    return scan && make_map ? make_map(scan->folder, name) : std::nullopt;
  }
  web::ResultNotes Notes(const std::string& scan_id, web::Language language) override {
    const auto scan = FindScan(scan_id);
    const bool is_spanish = language == web::Language::kSpanish;
    const web::ResultTerms& terms = is_spanish ? web::kSpanishTerms : web::kEnglishTerms;
    const std::string said(
        web::DailyCheckCaution(scan ? scan->daily_check : web::DailyCheck::kPassed, terms));
    web::ResultNotes notes{.axes = axis_names, .cautions = {}};
    if (is_spanish) std::ranges::copy(terms.axes, notes.axes.begin());
    if (!said.empty()) notes.cautions.push_back(said);
    return notes;
  }
  /// In English.
  std::array<std::string, 6> axis_names = {"Vertical", "Longitudinal", "Lateral",
                                           "Pitch",    "Roll",         "Yaw"};
  std::optional<std::string> PictureOf(const std::string&, web::ComparisonPicture picture,
                                       web::Language language) override {
    if (!draws_pictures) return std::nullopt;
    return std::string(picture == web::ComparisonPicture::kOverlay ? "overlay" : "error map") +
           (language == web::Language::kSpanish ? " in Spanish" : " in English");
  }
  bool draws_pictures = false;
  bool is_unreadable = false;  ///< Signed acts on references throw, as those of the real store.
  std::optional<std::string> ScanReport(const std::string& scan_id,
                                        web::Language language) override {
    report_language = language;
    return FindScan(scan_id) ? std::optional<std::string>("%PDF-1.5 a scan") : std::nullopt;
  }
  std::optional<std::string> CourseReport(const std::string& patient_id,
                                          web::Language language) override {
    report_language = language;
    return FindPatient(patient_id) ? std::optional<std::string>("%PDF-1.5 a course") : std::nullopt;
  }
  web::Language report_language = web::Language::kEnglish;  ///< Of the last report.
  web::CheckStatus GetChecks() override { return checks; }
  void OpenCheck(const web::Actor& actor, web::Done done) override;
  void SetCheckBaseline(const web::Actor& actor, const std::string& check_id,
                        web::Done done) override;
  web::RoomCalibrationStatus GetRoomCalibration() override { return room; }
  void SignRoomCalibration(const web::Actor& actor, const std::string& digest,
                           web::Done done) override;
  std::optional<std::string> RoomBoardPdf(std::string& why_not) override;
  web::SensorProfiles GetSensorProfiles() override { return profiles; }
  std::optional<std::string> SensorProfileFile(int version) override;
  void ResetSensorProfile(const web::Actor& actor, const std::string& serial,
                          web::Done done) override;
  void RollBackSensorProfile(const web::Actor& actor, const std::string& serial, int version,
                             web::Done done) override;
  std::vector<web::Display> Displays() override { return displays; }
  void AddDisplay(const web::Actor& actor, const web::Display& display, web::Done done) override;
  void RemoveDisplay(const web::Actor& actor, const std::string& id, web::Done done) override;
  std::string WhyUnreadable() override { return accounts_fault; }
  std::vector<web::User> Users() override { return users; }
  std::optional<web::User> FindUser(const std::string& name) override;
  void AddUser(const web::Actor& actor, const web::User& user, web::Done done) override;
  void ChangeUser(const web::Actor& actor, const web::UserChange& change, web::Done done) override;
  web::Preferences PreferencesOf(const std::string& name) override { return preferences_[name]; }
  void SetPreferences(const web::Actor& actor, const web::Preferences& preferences,
                      web::Done done) override;
  void Log(const web::Actor& actor, const std::string& action, const std::string& subject,
           const std::string& detail) override;
  std::vector<web::AuditEntry> Audit(const web::AuditQuery& query) override;
  web::Settings GetSettings() override { return settings; }
  void ChangeSettings(const web::Actor& actor, const web::SettingsChange& change,
                      web::Done done) override;
  web::UpdateStatus GetUpdate() override { return update; }
  void AddBundle(const web::Actor& actor, const std::filesystem::path& file,
                 const std::string& name, web::Done done) override;
  void RemoveBundle(const web::Actor& actor, const std::string& name, web::Done done) override;
  void InstallUpdate(const web::Actor& actor, const std::string& bundle, web::Done done) override;
  [[nodiscard]] std::vector<std::string> StickBundles() override { return stick; }
  void InstallFromStick(const web::Actor& actor, const std::string& bundle,
                        web::Done done) override;
  void RestartSystem(const web::Actor& actor, web::Done done) override;
  void ResetToFactory(const web::Actor& actor, web::FactoryReset kind, web::Done done) override;
  void ForgetRollBack(const web::Actor& actor, web::Done done) override;
  void WriteDiagnostics(const web::Actor& actor, web::Done done) override;

  /// A reference made of a scan, as AddReference() does it, without the log.
  web::Reference& MakeReference(const web::Scan& scan, const std::string& by,
                                const std::string& reason);

 private:
  [[nodiscard]] static web::Change Refusal(web::ChangeResult result, std::string message);
  /// As the store describes it; sessions are remembered, all else is looked up.
  [[nodiscard]] std::optional<web::AuditSubject> SubjectOf(const web::AuditEntry& entry);
  void Finish(const web::Done& done, web::Change change);
  void Did(const web::Actor& actor, const std::string& action, const std::string& subject,
           const web::Done& done, const std::string& id = "");
  void EndScan();
  void TellWaiting();
  [[nodiscard]] bool IsOld(const web::Scan& scan) const;
  void EndCheck();
  void CloseCheck();
  [[nodiscard]] web::Patient* PatientOf(const std::string& id);

  std::function<void(web::EventKind)> listener_;
  std::optional<std::chrono::steady_clock::time_point> phase_begun_;
  std::size_t num_finished_ = 0;
  bool is_check_ = false;  ///< The next or running scan is a check.
  std::string checker_, patient_before_check_;
  int next_id_ = 1;
  std::map<std::string, web::Preferences> preferences_;
  std::map<std::string, int> num_fractions_;
  std::map<std::string, web::TreatmentSession> sessions_;  ///< By id: all that were opened.
};

}  // namespace plumb::test
