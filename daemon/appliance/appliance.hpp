// The appliance: sensor, button, light, scans and store behind one state, on the event loop.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "daemon/appliance/page_identity.hpp"
#include "daemon/appliance/scan_session.hpp"
#include "daemon/appliance/scan_state.hpp"
#include "daemon/appliance/sensor_thread.hpp"
#include "daemon/config/config.hpp"
#include "daemon/loop/clock_watch.hpp"
#include "daemon/loop/event_loop.hpp"
#include "daemon/loop/work_thread.hpp"
#include "daemon/records/store.hpp"
#include "drivers/button.hpp"
#include "drivers/indicator.hpp"
#include "web/service/appliance_service.hpp"
#include "web/service/room_calibration_service.hpp"

namespace plumb {

/// What an appliance is made of. Borrowed objects live longer than it.
struct ApplianceParts {
  Config config;
  /// Why the configuration cannot be used; empty: it can. If not, the appliance is in safe mode and
  /// touches nothing that is stored, because the folder may be another than the one that was meant.
  std::string configuration_fault;
  std::function<std::unique_ptr<SensorProvider>()> make_provider;  ///< Called on the sensor thread.
  std::function<void()> before_scan;                               ///< See SensorThreadOptions.
  Button* button = nullptr;                                        ///< None: only others press.
  Indicator* indicator = nullptr;
  /// The patient of the session that is open from the start; its first scan becomes its reference,
  /// approved by "auto". Empty: scans are of no patient until a session is opened.
  std::string demo_patient;
  /// Of a thread that works: after so long without progress it counts as dead. Opening a sensor on
  /// a slow bus takes some seconds, the longest single step, a comparison of two large scenes, a
  /// few.
  double sensor_silence_s = 30.0;
  double worker_silence_s = 30.0;
};

/// Not thread-safe: call it on the loop's thread, but for functions that say "from any thread".
/// They return at once. Its own threads are in daemon/README.md.
class Appliance {
 public:
  Appliance(EventLoop& loop, ApplianceParts parts);
  ~Appliance();
  Appliance(const Appliance&) = delete;
  Appliance& operator=(const Appliance&) = delete;

  /// Empty when the appliance does it, else one sentence why not.
  using Answer = std::string;
  Answer Press(ButtonPress press);
  /// As a press, for one purpose each.
  Answer StartSweep();
  Answer EndSweep();
  /// Discards the running scan.
  Answer Cancel();
  /// Off the loop, while scans go on. Calls `done` on the loop, with why none was made (empty: it
  /// was) and what it holds.
  /// @param key_file  Whose key encrypts it; empty: the configured one, if any.
  void BackUp(const web::Actor& actor, const std::filesystem::path& folder,
              std::function<void(const std::string& error, const BackupReport& report)> done,
              const std::filesystem::path& key_file = {});
  /// Where a backup of today belongs; empty: no folder is configured.
  [[nodiscard]] std::filesystem::path BackupTarget() const;
  /// Asked before each scan: a reason why none may begin now, or nothing.
  void SetBlockingReason(std::function<std::string()> blocking_reason) {
    blocking_reason_ = std::move(blocking_reason);
  }
  /// Why no reference may be scanned or approved now, with the next step: no daily check has passed
  /// today. Empty: it may, as always in the demo. @param scan  That is to be the reference: one
  /// that was taken while the check was overdue is confirmed by a check of the same day
  /// (CheckStore::ConfirmsScan), or has to be repeated.
  [[nodiscard]] std::string WhyNoReference(const std::optional<web::Scan>& scan = {});
  /// The session that the store has opened: scans belong to it until it is closed.
  void OpenSession(const std::string& session_id, const std::string& patient_id,
                   web::ScanPurpose purpose, const std::string& reason, const web::Actor& actor);
  /// The session is over, in the store too. Not while a scan runs.
  Answer CloseSession(const web::Actor& actor);
  /// Until the store has opened a session no scan begins.
  void SetOpening(bool opening) { opening_ = opening; }
  [[nodiscard]] bool IsRunning() const;
  /// Why the machine may not be restarted now: a scan runs, or a patient's session is open (the
  /// demo's counts as none). Empty: it may.
  [[nodiscard]] Answer WhyNotRestart() const;
  /// Told by status and light until it is empty: the machine has gone back to the previous system.
  void SetRolledBack(const std::string& text);
  [[nodiscard]] const std::string& session_id() const { return session_id_; }
  /// If this one is open, none is any more. A daily check that is open stays so.
  void ClosePatient(const std::string& patient_id);
  /// The next scan is the daily check of the room's markers; after it, scans are of the open
  /// patient again.
  Answer OpenCheck(const web::Actor& actor);
  [[nodiscard]] web::CheckStatus Checks();
  /// Reads anew which calibration of the room holds, and whether a marker moved since.
  void LookAtRoom();
  /// From any thread.
  [[nodiscard]] web::RoomCalibrationStatus RoomCalibration();
  /// Which board belongs to the room's markers; from any thread.
  [[nodiscard]] std::string RoomBoardPdf() const;
  /// Whose scans of the board, and since when, count for the next calibration.
  [[nodiscard]] std::pair<std::string, web::WallClock::time_point> RoomScansWanted() const;
  /// Of the connected sensor unit; from any thread.
  [[nodiscard]] web::SensorProfiles SensorProfiles() const;
  [[nodiscard]] std::optional<std::string> SensorProfileFile(int version) const;
  /// Why the profile of that unit may not be changed now; empty: it may.
  [[nodiscard]] Answer WhyNotChangeProfile(const std::string& serial) const;
  [[nodiscard]] const std::shared_ptr<ProfileShelf>& profiles() const { return profiles_; }
  /// What the last scan said against the profile is of the past.
  void ForgetDrift();
  /// Of the last result of this run, by a clock that does not step; nothing for another scan.
  [[nodiscard]] std::optional<double> AgeOf(const std::string& scan_id) const;
  /// Takes over what may change while running; what may not is logged. For SIGHUP.
  void Reload(const Config& config);
  /// Calls `stopped` once no scan runs any more; a running one is discarded.
  void Stop(std::function<void()> stopped);

  /// Each event as one JSON object ({"event", "time", ...}); to the control socket's watchers.
  void SetEventListener(std::function<void(const std::string& line)> listener) {
    tell_watchers_ = std::move(listener);
  }
  void SetWebListener(std::function<void(web::EventKind)> listener) {
    tell_web_ = std::move(listener);
  }

  /// What the status says of the page.
  void SetPage(PageNotes page) { page_ = std::move(page); }
  /// What the control socket answers to "status".
  [[nodiscard]] nlohmann::json StatusJson();
  [[nodiscard]] web::Status WebStatus();
  [[nodiscard]] web::Health Health();
  /// One line for systemd.
  [[nodiscard]] std::string StatusLine() const;
  /// False while a busy worker shows no progress: systemd's watchdog must then not be fed.
  [[nodiscard]] bool WorkersAreAlive() const;

  /// In safe mode one that can only be read, or null.
  [[nodiscard]] Store* store() { return store_.get(); }
  [[nodiscard]] const std::filesystem::path& state_folder() const {
    return parts_.config.appliance.state;
  }
  [[nodiscard]] const std::string& storage_fault() const { return storage_fault_; }
  [[nodiscard]] std::optional<Frame> LatestFrame() const { return sensors_->latest(); }
  /// Of the sweep that goes on; null: none does, or it has shown nothing yet.
  [[nodiscard]] std::shared_ptr<const LiveSurfaceView> SurfaceSoFar() const {
    return state_.phase == ScanPhase::kScanning ? scan_.update.surface : nullptr;
  }
  [[nodiscard]] const ScanState& state() const { return state_; }
  /// Changes of the store, one after the other, off the loop.
  [[nodiscard]] WorkThread& store_thread() { return store_thread_; }
  [[nodiscard]] EventLoop& loop() { return loop_; }
  /// Of a new reference, from settings and configuration.
  [[nodiscard]] web::ReferencePlan DefaultPlan();
  void NotifyDataChanged() { NotifyWeb(web::EventKind::kData); }

 private:
  /// The scan that runs, or the last one.
  struct CurrentScan {
    std::string id;  ///< Empty until the store gave one.
    std::string patient_id;
    std::string reference_id;
    web::ScanPurpose purpose = web::ScanPurpose::kFraction;
    double reference_area_m2 = 0.0;
    std::chrono::steady_clock::time_point started, ended;
    double first_frame_ms = 0.0;  ///< From the press to the first frame used.
    double cancel_ms = 0.0;       ///< From the cancellation to its end.
    std::chrono::steady_clock::time_point cancelled_at;
    SensorStatistics sensor_before;  ///< Its counters when the scan began.
    SensorStatistics images;         ///< What it counted during the sweep.
    ScanUpdate update;
    double dropped_share = 0.0;  ///< Of the images of the last two seconds, smoothed.
    ScanOutcome outcome;
    bool has_ended = false;
  };

  static constexpr int kDiskCheckTicks = 10;      ///< Seconds, while no scan runs.
  static constexpr int kMaintenanceTicks = 3600;  ///< Likewise.
  static constexpr int kFirstFileCheckTicks = 30;
  static constexpr int kBackupTicks = 60;  ///< Until it is looked at whether one is due.

  void OpenStore();
  void LogRecovery(const RecoveryReport& found) const;
  Answer Handle(ScanEvent event);
  void ArmSessionTimer();
  void OnSessionTimer();
  void ForgetSession();
  [[nodiscard]] bool IsOwnSession() const;
  [[nodiscard]] std::optional<double> SecondsSinceSensor() const;
  [[nodiscard]] bool IsCheckOverdue();
  void NoteDropped(const ScanUpdate& update);
  void Act(ScanAction action);
  Answer WhyNotScan() const;
  void StartScan();
  void BeginSession();
  [[nodiscard]] ScanJob MakeJob(const web::Settings& settings);
  [[nodiscard]] std::optional<RoomAxes> RoomOfJob() const;
  void ReportRoom(web::Status& status) const;
  [[nodiscard]] std::shared_ptr<UnitProfile> MakeUnitProfile();
  [[nodiscard]] std::string WhyNoProfile(const SensorDescription& sensor) const;
  [[nodiscard]] static bool ProfilesOff(const Config& config);
  [[nodiscard]] ScanCallbacks MakeCheckCallbacks(const NewScan& scan);
  void AddListeners(ScanCallbacks& callbacks);
  [[nodiscard]] ScanCallbacks MakeCallbacks(const NewScan& scan);
  void OnSensor(const SensorEvent& event);
  void LogSensor(const SensorEvent& event);
  void OnUpdate(const ScanUpdate& update);
  void OnEnded(const ScanOutcome& outcome);
  void OnTick();
  void WatchButton();
  void ArmButtonTimer();
  void RunMaintenance();
  void CheckDisk();
  void CheckStoredFiles();
  void BackUpIfDue();
  [[nodiscard]] std::uint64_t NeededBytes() const;
  [[nodiscard]] Answer WhyNoSpace() const;
  [[nodiscard]] std::vector<std::string> StorageWarnings() const;
  [[nodiscard]] std::uint64_t QuotaBytes() const;
  void FailStorage(const std::string& what);
  void ReadStored(web::Status& status);
  void Show();
  [[nodiscard]] IndicatorPattern Pattern() const;
  void PublishEvent(const char* event, const nlohmann::json& fields);
  void PublishState();
  void PublishProgress();
  void NotifyWeb(web::EventKind kind);
  [[nodiscard]] std::optional<double> Coverage() const;
  [[nodiscard]] std::string FaultReason() const;

  /// The calibration that holds, as LookAtRoom() found it.
  struct Room {
    std::optional<SignedRoom> calibration;
    std::string due;  ///< Set without a calibration: one is stored, but cannot be read.
    bool is_configured = false;
  };

  EventLoop& loop_;
  ApplianceParts parts_;
  mutable std::mutex room_mutex_;  ///< Changed on the loop, read from any thread.
  Room room_;
  std::unique_ptr<Store> store_;
  std::string storage_fault_, backup_fault_;
  std::shared_ptr<ProfileShelf> profiles_;
  std::atomic<bool> profiles_off_;
  std::string profile_fault_;  ///< That the sensor contradicted its profile in the last scan.
  std::function<std::string()> blocking_reason_;
  int ticks_to_disk_check_ = kDiskCheckTicks;
  int ticks_to_maintenance_ = kMaintenanceTicks;
  int ticks_to_file_check_ = kFirstFileCheckTicks;
  int ticks_to_backup_ = kBackupTicks;
  ClockWatch clock_{std::chrono::system_clock::now(), std::chrono::steady_clock::now()};
  std::stop_source care_;  ///< Stopped when the appliance ends.
  ScanState state_;
  std::string sensor_fault_, scan_fault_, rolled_back_;
  std::string session_id_, open_patient_, reference_reason_;
  web::Actor opened_by_;  ///< The session.
  web::ScanPurpose purpose_ = web::ScanPurpose::kFraction;
  bool opening_ = false;
  std::optional<web::Actor>
      check_;  ///< Set: the next or running scan is the daily check that this person asked for.
  CurrentScan scan_;
  std::optional<CurrentScan> last_result_;
  std::chrono::steady_clock::time_point sensor_since_;
  std::string last_serial_;  ///< Of the sensor that was used last.
  PageNotes page_;
  IndicatorPattern shown_ = IndicatorPattern::kOff;
  std::function<void(const std::string&)> tell_watchers_;
  std::function<void(web::EventKind)> tell_web_;
  std::function<void()> stopped_;
  EventLoop::Source result_timer_, limit_timer_, session_timer_, tick_timer_, button_source_,
      button_timer_;
  WorkThread store_thread_{256};
  WorkThread check_thread_{4};  ///< Reads stored files; changes do not wait for it.
  std::unique_ptr<SensorThread> sensors_;
  std::unique_ptr<ScanSession> session_;  // last: its thread uses what is above
};

/// Midnight, local time.
[[nodiscard]] web::WallClock::time_point StartOfDay();

/// "off", "no_sensor", "ready", ...
[[nodiscard]] const char* Name(IndicatorPattern pattern);

}  // namespace plumb
