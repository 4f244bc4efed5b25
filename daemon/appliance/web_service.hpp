// The appliance as the page asks for it.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "daemon/appliance/appliance.hpp"
#include "daemon/appliance/updates.hpp"
#include "web/service/scan_service.hpp"

namespace plumb {

/// Reads answer at once, or within Later() on a thread of theirs; changes run on the store's thread
/// and call `done` on the loop. Belongs to the loop's thread. In safe mode lists are empty and
/// changes fail with the reason.
class WebService : public web::ScanService {
 public:
  /// The appliance is borrowed; lives longer. @param restart  How the machine is restarted.
  WebService(Appliance& appliance, const UpdateConfig& update,
             std::unique_ptr<SystemRestart> restart);
  ~WebService() override;

  [[nodiscard]] bool Later(web::Aside where, std::function<void()> work,
                           std::function<void()> done) override;
  [[nodiscard]] web::Status GetStatus() override { return appliance_.WebStatus(); }
  [[nodiscard]] web::Health GetHealth() override { return appliance_.Health(); }
  [[nodiscard]] std::shared_ptr<const std::string> Preview() override;
  void Press(const web::Actor& actor, web::Done done) override;
  void StartSweep(const web::Actor& actor, web::Done done) override;
  void EndSweep(const web::Actor& actor, web::Done done) override;
  void Cancel(const web::Actor& actor, web::Done done) override;
  void SetListener(std::function<void(web::EventKind)> listener) override;

  [[nodiscard]] std::vector<web::Patient> Patients() override;
  [[nodiscard]] std::optional<web::Patient> FindPatient(const std::string& id) override;
  void AddPatient(const web::Actor& actor, const std::string& code, const std::string& site,
                  web::Done done) override;
  void ChangePatient(const web::Actor& actor, const std::string& id, const std::string& site,
                     const std::string& note, web::Done done) override;
  void ArchivePatient(const web::Actor& actor, const std::string& id, bool archived,
                      web::Done done) override;
  void WipePatient(const web::Actor& actor, const std::string& id, web::Done done) override;
  void OpenPatient(const web::Actor& actor, const std::string& id, web::ScanPurpose purpose,
                   const std::string& reason, const std::string& replaces, web::Done done) override;
  void CloseSession(const web::Actor& actor, const std::string& session_id,
                    web::Done done) override;

  [[nodiscard]] std::vector<web::Reference> References(const std::string& patient_id) override;
  [[nodiscard]] std::optional<web::Reference> FindReference(const std::string& id) override;
  void AddReference(const web::Actor& actor, const std::string& scan_id, const std::string& reason,
                    web::Done done) override;
  void PlanReference(const web::Actor& actor, const std::string& id, int revision,
                     const web::ReferencePlan& plan, web::Done done) override;
  void ApproveReference(const web::Actor& actor, const std::string& id, int revision,
                        const std::string& digest, web::Done done) override;

  [[nodiscard]] std::vector<web::Scan> Scans(const std::string& patient_id, int limit) override;
  [[nodiscard]] std::optional<web::Scan> FindScan(const std::string& id) override;
  void RemoveScan(const web::Actor& actor, const std::string& id, const std::string& reason,
                  web::Done done) override;
  void MakeBackup(const web::Actor& actor, web::Done done) override;
  void AcceptScan(const web::Actor& actor, const std::string& id, const std::string& reason,
                  web::Done done) override;

  [[nodiscard]] std::optional<std::string> CompactMap(const std::string& scan_id,
                                                      const std::string& name) override;

  [[nodiscard]] std::optional<std::string> ScanReport(const std::string& scan_id,
                                                      web::Language language) override;
  [[nodiscard]] std::optional<std::string> CourseReport(const std::string& patient_id,
                                                        web::Language language) override;

  [[nodiscard]] web::CheckStatus GetChecks() override;
  void OpenCheck(const web::Actor& actor, web::Done done) override;
  void SetCheckBaseline(const web::Actor& actor, const std::string& check_id,
                        web::Done done) override;
  [[nodiscard]] web::SensorProfiles GetSensorProfiles() override;
  [[nodiscard]] std::optional<std::string> SensorProfileFile(int version) override;
  void ResetSensorProfile(const web::Actor& actor, const std::string& serial,
                          web::Done done) override;
  void RollBackSensorProfile(const web::Actor& actor, const std::string& serial, int version,
                             web::Done done) override;

  [[nodiscard]] std::vector<web::Display> Displays() override;
  void AddDisplay(const web::Actor& actor, const web::Display& display, web::Done done) override;
  void RemoveDisplay(const web::Actor& actor, const std::string& id, web::Done done) override;

  [[nodiscard]] std::vector<web::User> Users() override;
  [[nodiscard]] std::optional<web::User> FindUser(const std::string& name) override;
  void AddUser(const web::Actor& actor, const web::User& user, web::Done done) override;
  void ChangeUser(const web::Actor& actor, const web::UserChange& change, web::Done done) override;
  void Log(const web::Actor& actor, const std::string& action, const std::string& subject,
           const std::string& detail) override;
  [[nodiscard]] std::vector<web::AuditEntry> Audit(std::int64_t before, int limit) override;
  [[nodiscard]] std::vector<web::PlanTemplate> Templates() override;
  void SetTemplate(const web::Actor& actor, const web::PlanTemplate& wanted,
                   web::Done done) override;
  void RemoveTemplate(const web::Actor& actor, const std::string& site, web::Done done) override;
  [[nodiscard]] web::Settings GetSettings() override;
  void ChangeSettings(const web::Actor& actor, const web::Settings& settings,
                      web::Done done) override;

  [[nodiscard]] web::UpdateStatus GetUpdate() override { return updates_.GetStatus(); }
  void AddBundle(const web::Actor& actor, const std::filesystem::path& file,
                 const std::string& name, web::Done done) override {
    updates_.Add(actor, file, name, done);
  }
  void RemoveBundle(const web::Actor& actor, const std::string& name, web::Done done) override {
    updates_.Remove(actor, name, done);
  }
  void InstallUpdate(const web::Actor& actor, const std::string& bundle, web::Done done) override {
    updates_.Install(actor, bundle, std::move(done));
  }
  void RestartSystem(const web::Actor& actor, web::Done done) override {
    updates_.Restart(actor, std::move(done));
  }
  void ForgetRollBack(const web::Actor& actor, web::Done done) override {
    updates_.ForgetRollBack(actor, done);
  }
  void WriteDiagnostics(const web::Actor& actor, web::Done done) override;
  [[nodiscard]] Updates& updates() { return updates_; }

 private:
  /// As Change(); once it is done the last scan's word against the profile is forgotten.
  void ChangeProfile(const std::string& serial, web::Done done,
                     std::function<std::string(Store&)> change);
  /// Runs `change` on the store's thread; what it returns is the id of what was made, what it
  /// throws becomes the answer.
  void Change(web::Done done, std::function<std::string(Store&)> change);
  /// A read that fails (a damaged database) is logged and gives what `otherwise` is.
  template <typename Result>
  Result Read(const std::function<Result(Store&)>& read, Result otherwise) const;

  Appliance& appliance_;
  std::function<void(web::EventKind)> listener_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
  std::shared_ptr<const std::string> preview_;
  std::int64_t preview_index_ = -1;
  std::chrono::steady_clock::time_point preview_at_;
  // Declared last, so destroyed first: their callbacks use the members above.
  Updates updates_;
  WorkThread reads_{64}, files_{64};
};

}  // namespace plumb
