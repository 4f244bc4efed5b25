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

#include "algo/base/pose.hpp"
#include "algo/comparison/body_parts.hpp"
#include "daemon/appliance/control_lines.hpp"
#include "daemon/appliance/current_store.hpp"
#include "daemon/appliance/page_identity.hpp"
#include "daemon/appliance/scan_session.hpp"
#include "daemon/appliance/scan_state.hpp"
#include "daemon/appliance/sensor_thread.hpp"
#include "daemon/config/config.hpp"
#include "daemon/loop/clock_watch.hpp"
#include "daemon/loop/event_loop.hpp"
#include "daemon/loop/work_thread.hpp"
#include "drivers/button.hpp"
#include "drivers/indicator.hpp"
#include "web/service/appliance_service.hpp"
#include "web/service/room_services.hpp"

namespace plumb {

/// Dependencies of an appliance. Borrowed objects live longer than it.
struct ApplianceParts {
  Config config;
  /// Why the configuration cannot be used; empty if it can. If it cannot, the appliance is in safe
  /// mode and does not touch stored data, because the configured folder may be another.
  std::string configuration_fault;
  std::function<std::unique_ptr<SensorProvider>()> make_provider;  ///< Called on the sensor thread.
  std::function<void()> before_scan;                               ///< See SensorThreadOptions.
  Button* button = nullptr;  ///< Null: presses come from elsewhere only.
  Indicator* indicator = nullptr;
  /// The patient of the session that is open from the start; its first scan becomes its reference,
  /// approved by "auto". Empty: scans belong to no patient until a session is opened.
  std::string demo_patient;
  /// Time without progress after which a working thread counts as hung. The longest single steps
  /// take a few seconds: opening a sensor on a slow bus, and comparing two large scenes.
  double sensor_silence_s = 30.0;
  double worker_silence_s = 30.0;
  /// Longest check of the whole database at the start. A larger one is checked while the appliance
  /// already works.
  std::chrono::milliseconds check_limit = StoreOptions().check_limit;
  /// Pauses between the attempts to leave safe mode; the last one is repeated.
  std::vector<std::chrono::milliseconds> storage_retries = {
      std::chrono::seconds(10), std::chrono::seconds(60), std::chrono::seconds(300)};
  /// Measures the room on the disk of a folder. Empty: asks the system.
  std::function<std::filesystem::space_info(const std::filesystem::path&, std::error_code&)> space =
      {};
  /// Unit of the intervals between checks, removals and backups.
  std::chrono::milliseconds tick{1000};
  /// Nothing is removed for its age until the wall clock has run for so long without a step: a time
  /// server may still correct it.
  std::chrono::milliseconds clock_trusted_after = std::chrono::hours(1);
};

/// Not thread-safe: call it on the loop's thread, except for functions marked "from any thread".
/// They return at once. Its threads: daemon/README.md. The loop must not run after its destruction.
class Appliance {
 public:
  Appliance(EventLoop& loop, ApplianceParts parts);
  ~Appliance();
  Appliance(const Appliance&) = delete;
  Appliance& operator=(const Appliance&) = delete;

  /// Empty if the appliance does it, otherwise one sentence why not.
  using Answer = std::string;
  /// The audit log names the actor of this and the next three functions, and the session of the
  /// scan that the call started, ended or discarded.
  Answer Press(ButtonPress press, const Actor& actor);
  /// Like a press, but for one purpose each.
  Answer StartSweep(const Actor& actor);
  Answer EndSweep(const Actor& actor);
  /// Discards the running scan.
  Answer Cancel(const Actor& actor);
  /// Makes a backup off the loop, while scans continue. Calls `done` on the loop with an error
  /// (empty if it was made) and the contents.
  /// @param key_file  Key for encryption; empty: the configured one, if any.
  void BackUp(const Actor& actor, const std::filesystem::path& folder,
              std::function<void(const std::string& error, const BackupReport& report)> done,
              const std::filesystem::path& key_file = {});
  /// Target of today's backup; empty if no folder is configured.
  [[nodiscard]] std::filesystem::path BackupTarget() const;
  /// Called before each scan; returns a reason why none may begin now, or nothing.
  void SetBlockingReason(std::function<std::string()> blocking_reason) {
    blocking_reason_ = std::move(blocking_reason);
  }
  [[nodiscard]] Answer WhyBlocked() const {
    return blocking_reason_ ? blocking_reason_() : std::string();
  }
  /// Why no reference may be scanned or approved now, with the next step: the daily check is
  /// overdue or has failed, or the sensor is still warming up. Empty if it may, as always in the
  /// demo.
  /// @param scan  The scan that is to be the reference. One taken before a check had passed must be
  ///         confirmed by a later check of the same day (CheckStore::ConfirmsScan), or repeated. It
  ///         must also be repeated if the first check after it failed.
  [[nodiscard]] std::string WhyNoReference(const std::optional<Scan>& scan = {});
  /// Time that the sensor must have been on before a reference scan; from any thread.
  [[nodiscard]] double warm_up_min() const { return warm_up_min_; }
  /// The session that the store has opened: scans belong to it until it is closed.
  void OpenSession(const std::string& session_id, const std::string& patient_id,
                   ScanPurpose purpose, const std::string& reason, const Actor& actor);
  /// Ends the session, also in the store. Not while a scan runs.
  Answer CloseSession(const Actor& actor);
  /// Until the store has opened a session, no scan begins, and no session is opened or closed.
  void SetOpening(bool opening) { opening_ = opening; }
  /// The same while the store removes the data of the patient whose session is open.
  void SetWiping(bool wiping) { wiping_ = wiping; }
  /// Why no session can be opened or closed at the moment; empty: one can.
  [[nodiscard]] Answer WhyNotChangeSession() const;
  [[nodiscard]] bool IsRunning() const;
  /// For what has to wait until no scan runs; empty: none does.
  [[nodiscard]] Answer WhyNotIdle() const;
  /// Why the machine may not be restarted now: a scan runs, or a patient's session is open (the
  /// demo's does not count). Empty if it may.
  [[nodiscard]] Answer WhyNotRestart() const;
  /// The same for a system update, during which no scan can begin.
  [[nodiscard]] Answer WhyNotInstall() const;
  /// Shown by status and light until it is empty: the machine has gone back to the previous system.
  void SetRolledBack(const std::string& text);
  [[nodiscard]] const std::string& session_id() const { return session_id_; }
  [[nodiscard]] const std::string& open_patient() const { return open_patient_; }
  /// Closes this patient if it is open. An open daily check stays open.
  void ClosePatient(const std::string& patient_id);
  /// The next scan is the daily check of the room's markers; scans after it belong to the open
  /// patient again.
  Answer OpenCheck(const Actor& actor);
  [[nodiscard]] CheckStatus Checks();
  /// Reloads the calibration of the room, and whether a marker has moved since.
  void RefreshRoom();
  /// Where the gantry is on the maps of a scene, as a comparison with it would find it; not set if
  /// the room is not known. From any thread.
  /// @param scene  Its markers: the reference marker may have lain otherwise than when the room
  ///         was calibrated.
  [[nodiscard]] std::optional<RoomWays> RoomIn(const MarkerMap& scene) const;
  /// From any thread.
  [[nodiscard]] web::RoomCalibrationStatus RoomCalibration();
  /// The board for the room's markers; from any thread.
  [[nodiscard]] std::string RoomBoardPdf() const;
  /// Whose scans of the board count for the next calibration, and since when; from any thread.
  [[nodiscard]] std::pair<std::string, WallClock::time_point> RoomScansWanted() const;
  /// Profile of the connected sensor unit; from any thread.
  [[nodiscard]] SensorProfiles UnitProfiles() const;
  [[nodiscard]] std::optional<std::string> SensorProfileFile(int version) const;
  /// Why the profile of that unit may not be changed now; empty if it may.
  [[nodiscard]] Answer WhyNotChangeProfile(const std::string& serial) const;
  [[nodiscard]] const std::shared_ptr<ProfileShelf>& profiles() const { return profiles_; }
  /// Discards the last scan's objection to the profile.
  void ForgetDrift();
  /// Age of the last result of this run, by a monotonic clock; nothing for another scan.
  [[nodiscard]] std::optional<double> AgeOf(const std::string& scan_id) const;
  /// Applies changes that are possible while running and logs those that are not. For SIGHUP.
  void Reload(const Config& config);
  /// Calls `stopped` once no scan runs any more; a running one is discarded.
  void Stop(std::function<void()> stopped);

  /// Sends each event as one JSON object ({"event", "time", ...}) to the control socket's watchers.
  void SetEventListener(std::function<void(const std::string& line)> listener) {
    notify_watchers_ = std::move(listener);
  }
  void SetWebListener(std::function<void(web::EventKind)> listener) {
    notify_page_ = std::move(listener);
  }

  /// The status of the page.
  void SetPage(PageNotes page) { page_ = std::move(page); }
  /// The answer of the control socket to "status".
  [[nodiscard]] nlohmann::json StatusJson();
  [[nodiscard]] Status WebStatus();
  [[nodiscard]] Health health();
  /// One line for systemd.
  [[nodiscard]] std::string StatusLine() const;
  /// False if a busy worker shows no progress: systemd's watchdog must then not be fed.
  [[nodiscard]] bool WorkersAreAlive() const;

  /// In safe mode a read-only store, or null. From any thread.
  [[nodiscard]] Store* store() { return store_.get(); }
  [[nodiscard]] const std::filesystem::path& state_folder() const {
    return parts_.config.appliance.state;
  }
  [[nodiscard]] const std::string& storage_fault() const { return storage_fault_; }
  /// Attempts to leave safe mode that were armed since it began.
  [[nodiscard]] std::size_t num_storage_retries() const { return num_storage_retries_; }
  [[nodiscard]] std::optional<Frame> LatestFrame() const { return sensors_->latest(); }
  /// Surface of the running sweep; null if there is none or nothing has been seen yet.
  [[nodiscard]] std::shared_ptr<const LiveSurfaceView> SurfaceSoFar() const {
    return state_.phase == ApplianceState::kScanning ? scan_.update.surface : nullptr;
  }
  [[nodiscard]] const ScanState& state() const { return state_; }
  /// Changes of the store, one after the other, off the loop.
  [[nodiscard]] WorkThread& store_thread() { return store_thread_; }
  [[nodiscard]] EventLoop& loop() { return loop_; }
  /// Plan of a new reference, from settings and configuration.
  [[nodiscard]] ReferencePlan DefaultPlan();
  void NotifyWeb(web::EventKind kind);

 private:
  /// The running or last scan.
  struct CurrentScan {
    std::string id;  ///< Empty until the store has assigned one.
    std::string patient_id;
    std::string session_id;
    std::string reference_id;
    ScanPurpose purpose = ScanPurpose::kFraction;
    double reference_area_m2 = 0.0;
    std::chrono::steady_clock::time_point started, ended;
    double first_frame_ms = 0.0;  ///< From the press to the first frame used.
    double cancel_ms = 0.0;       ///< From the cancellation to the end.
    std::chrono::steady_clock::time_point cancelled_at;
    SensorStatistics sensor_before;  ///< Counters of the sensor when the scan began.
    SensorStatistics images;         ///< Counters of the sensor for the sweep.
    ScanUpdate update;
    double dropped_share = 0.0;  ///< Fraction of images lost in the last two seconds, smoothed.
    EndedScan outcome;
    bool has_ended = false;
  };

  static constexpr int kDiskCheckTicks = 10;      ///< While no scan runs.
  static constexpr int kMaintenanceTicks = 3600;  ///< While no scan runs.
  static constexpr int kFirstFileCheckTicks = 30;
  static constexpr int kBackupTicks = 60;  ///< Interval at which a due backup is checked for.

  /// Why nothing can be stored.
  enum class StorageFault {
    kMayEnd,  ///< For example, a disk is read-only or not mounted.
    kDamage,  ///< The database is damaged: somebody has to restore a backup and restart plumbd.
  };

  void OpenStore();
  [[nodiscard]] std::unique_ptr<Store> OpenForWork(const std::filesystem::path& state,
                                                   StoreOptions options) const;
  void UseStore(std::unique_ptr<Store> store);
  void EnterSafeMode(const std::string& what, StorageFault kind);
  void ArmStorageRetry();
  void RetryStorage();
  void ProbeStore();
  void ReopenStore();
  void EndRetry(const std::string& what, StorageFault kind = StorageFault::kMayEnd);
  void LeaveSafeMode();
  void WatchSpace();
  void CountUnusable();
  void LogRecovery(const RecoveryReport& found) const;
  /// @param actor  Who asks for it; null: the appliance itself.
  Answer Handle(ScanEvent event, const Actor* actor = nullptr);
  void Audit(const Actor& actor, const std::string& action, const std::string& subject,
             const std::string& detail);
  /// Adds what a person did with the scan to the audit log.
  void AuditAct(ScanAction action, const Actor& actor);
  /// Purpose of the running or last scan by its stored name, or "unassigned".
  [[nodiscard]] std::string ScanKind() const;
  void ArmSessionTimer();
  void OnSessionTimer();
  void ForgetSession();
  [[nodiscard]] bool IsOwnSession() const;
  [[nodiscard]] bool HasPatientsSession() const;
  [[nodiscard]] std::optional<double> SecondsSinceSensor() const;
  [[nodiscard]] std::string WhySensorIsCold(const std::optional<Scan>& scan) const;
  [[nodiscard]] DailyCheck DailyCheckToday();
  void NoteDropped(const ScanUpdate& update);
  void Act(ScanAction action);
  Answer WhyNotScan() const;
  void StartScan();
  void BeginSession();
  [[nodiscard]] ScanJob MakeJob(const Settings& settings);
  [[nodiscard]] std::optional<RoomAxes> RoomOfJob() const;
  void ReportRoom(Status& status) const;
  [[nodiscard]] std::optional<Pose> RoomPose() const;
  [[nodiscard]] std::shared_ptr<UnitProfile> MakeUnitProfile();
  /// Empty if the unit has none of its own: some sensors are known only by their port.
  [[nodiscard]] static std::string OwnSerial(const SensorDescription& sensor);
  [[nodiscard]] std::string WhyNoProfile(const SensorDescription& sensor) const;
  [[nodiscard]] static bool ProfilesOff(const Config& config);
  [[nodiscard]] ScanCallbacks MakeCheckCallbacks(const NewScan& scan);
  void AddListeners(ScanCallbacks& callbacks);
  [[nodiscard]] ScanCallbacks MakeCallbacks(const NewScan& scan);
  void OnSensor(const SensorEvent& event);
  void LogSensor(const SensorEvent& event);
  void OnUpdate(const ScanUpdate& update);
  void OnEnded(const EndedScan& outcome);
  void OnTick();
  void WatchButton();
  void ArmButtonTimer();
  void RunMaintenance();
  void CheckDisk();
  void CheckStoredFiles();
  void CheckRecords();
  void BackUpIfDue();
  /// Of the state folder's disk, or of the one that scans/ is: the one with less room.
  [[nodiscard]] std::optional<std::filesystem::space_info> SpaceForScans() const;
  [[nodiscard]] std::filesystem::space_info SpaceOf(const std::filesystem::path& folder,
                                                    std::error_code& error) const;
  [[nodiscard]] int KeepWithinRoom(const std::stop_token& stop);
  [[nodiscard]] std::uint64_t NeededBytes() const;
  [[nodiscard]] Answer WhyFull() const;
  [[nodiscard]] Answer WhyNoSpace() const;
  [[nodiscard]] std::vector<std::string> StorageWarnings() const;
  [[nodiscard]] double UsedShare() const;
  [[nodiscard]] bool IsNearlyFull() const;
  void FailStorage(const std::string& what, StorageFault kind);
  void ReadStored(Status& status);
  void ReadStoredOrFail(Status& status);
  void Show();
  [[nodiscard]] IndicatorPattern Pattern() const;
  void PublishEvent(const WatchedEvent& event);
  void PublishState();
  [[nodiscard]] std::optional<double> Coverage() const;
  [[nodiscard]] std::string FaultReason() const;

  /// The calibration in use, as found by RefreshRoom().
  struct Room {
    std::optional<SignedRoom> calibration;
    std::string due;  ///< Set without a calibration: one is stored but cannot be read.
    std::optional<Pose> configured;  ///< T_iec_reference of the configuration.
  };

  EventLoop& loop_;
  ApplianceParts parts_;
  mutable std::mutex room_mutex_;  ///< Changed on the loop, read from any thread.
  Room room_;
  CurrentStore store_;
  std::string storage_fault_, backup_fault_;
  StorageFault storage_fault_kind_ = StorageFault::kMayEnd;
  std::string space_fault_;     ///< Why no scan can be stored although the store works.
  bool is_store_open_ = false;  ///< For changes; otherwise it is read-only, or there is none.
  std::size_t num_storage_retries_ = 0;
  std::chrono::steady_clock::time_point storage_works_since_;
  UnusableRecords unusable_;
  bool is_unusable_due_ = true;          ///< To be counted again.
  bool is_quota_useful_ = true;          ///< Removals have freed space; for the store's thread.
  std::string record_fault_;             ///< That the audit log is not as it was written.
  bool is_database_checked_ = false;     ///< Once it is open, the check thread's.
  bool backup_is_beside_scans_ = false;  ///< The last one to the configured folder.
  std::shared_ptr<ProfileShelf> profiles_;
  std::atomic<bool> profiles_off_;
  std::atomic<double> warm_up_min_;
  std::string profile_fault_;  ///< The sensor's contradiction of its profile in the last scan.
  std::function<std::string()> blocking_reason_;
  int ticks_to_disk_check_ = kDiskCheckTicks;
  int ticks_to_maintenance_ = kMaintenanceTicks;
  int ticks_to_file_check_ = kFirstFileCheckTicks;
  int ticks_to_backup_ = kBackupTicks;
  int ticks_to_record_check_ = 0;
  ClockWatch clock_{std::chrono::system_clock::now(), std::chrono::steady_clock::now()};
  std::stop_source maintenance_stop_;  ///< Stopped when the appliance is destroyed.
  ScanState state_;
  std::string sensor_fault_, scan_fault_, rolled_back_;
  std::string session_id_, open_patient_, reference_reason_;
  Actor opened_by_;  ///< The user who opened the session.
  ScanPurpose purpose_ = ScanPurpose::kFraction;
  bool opening_ = false;
  bool wiping_ = false;
  std::optional<Actor>
      check_;  ///< If set, the next or running scan is the daily check requested by this user.
  CurrentScan scan_;
  std::optional<CurrentScan> last_result_;
  std::chrono::steady_clock::time_point sensor_since_;
  std::string last_serial_;  ///< Serial of the last used sensor.
  PageNotes page_;
  IndicatorPattern shown_ = IndicatorPattern::kOff;
  std::function<void(const std::string&)> notify_watchers_;
  std::function<void(web::EventKind)> notify_page_;
  std::function<void()> stopped_;
  EventLoop::Source result_timer_, limit_timer_, session_timer_, tick_timer_, storage_timer_,
      button_source_, button_timer_;
  WorkThread store_thread_{256};
  WorkThread check_thread_{4};  ///< Reads stored files; changes do not wait for it.
  std::unique_ptr<SensorThread> sensors_;
  std::unique_ptr<ScanSession> session_;  // last: its thread uses the members above
};

/// Midnight, local time.
[[nodiscard]] WallClock::time_point StartOfDay();

}  // namespace plumb
