// SPDX-License-Identifier: Apache-2.0
// The appliance: sensor, button, light, scans and store behind one state, on the event loop.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <nlohmann/json_fwd.hpp>

#include "algo/base/message.hpp"
#include "daemon/appliance/button_watch.hpp"
#include "daemon/appliance/current_scan.hpp"
#include "daemon/appliance/scan_state.hpp"
#include "daemon/appliance/shared_parts.hpp"
#include "daemon/loop/event_loop.hpp"
#include "daemon/monitoring/rest_watch.hpp"
#include "daemon/scanning/scan_session.hpp"
#include "daemon/unit/page_identity.hpp"
#include "web/service/appliance_service.hpp"

namespace plumb {

/// Not thread-safe: call it on the loop's thread, except for functions marked "from any thread".
/// They return at once. Its threads: daemon/README.md. The loop must not run after its destruction.
/// Commands in, events out: who needs a part of it gets that from SharedParts.
class Appliance : private StorageUser {
 public:
  /// The parts are borrowed.
  explicit Appliance(SharedParts& shared);
  ~Appliance() override;
  Appliance(const Appliance&) = delete;
  Appliance& operator=(const Appliance&) = delete;

  /// Empty if the appliance does it, otherwise why not.
  using Answer = Message;
  /// The audit log names the actor of this and the next three functions, and the session of the
  /// scan that the call started, ended or discarded.
  Answer Press(ButtonPress press, const Actor& actor);
  /// Like a press, but for one purpose each.
  Answer StartSweep(const Actor& actor);
  Answer EndSweep(const Actor& actor);
  /// Discards the running scan.
  Answer Cancel(const Actor& actor);
  /// The session that the store has opened: scans belong to it until it is closed.
  void OpenSession(const std::string& session_id, const std::string& patient_id,
                   ScanPurpose purpose, const std::string& reason, const Actor& actor);
  /// Ends the session, also in the store. Not while a scan runs.
  Answer CloseSession(const Actor& actor);
  /// For what has to wait until no scan runs; empty: none does.
  [[nodiscard]] Answer WhyNotIdle() const;
  /// Shown by status and light until it is empty: the machine has gone back to the previous system.
  void SetRolledBack(const Message& why);
  /// Closes this patient if it is open. An open daily check stays open.
  void ClosePatient(const std::string& patient_id);
  /// The next scan is the daily check of the room's markers; scans after it belong to the open
  /// patient again. @param opens  False: the opened check is given up.
  Answer PrepareCheck(bool opens, const Actor& actor);
  /// Applies changes that are possible while running and logs those that are not. For SIGHUP.
  void Reload(const Config& config);
  /// Calls `stopped` once no scan runs any more; a running one is discarded.
  void Stop(std::function<void()> stopped);

  /// The status of the page.
  void SetPage(PageNotes page);
  /// The answer of the control socket to "status".
  [[nodiscard]] nlohmann::json StatusJson();
  [[nodiscard]] Status WebStatus();
  [[nodiscard]] Health health();
  /// One line for systemd.
  [[nodiscard]] std::string StatusLine() const;
  /// False if a busy worker shows no progress: systemd's watchdog must then not be fed.
  [[nodiscard]] bool WorkersAreAlive() const;

  /// Surface of the running sweep; null if there is none or nothing has been seen yet.
  [[nodiscard]] std::shared_ptr<const LiveSurfaceView> SurfaceSoFar() const {
    return state_.phase == ApplianceState::kScanning ? scan_.update.surface : nullptr;
  }
  [[nodiscard]] const ScanState& state() const { return state_; }

 private:
  [[nodiscard]] bool IsRunning() const override;
  /// Age of the last result of this run, by a monotonic clock; nothing for another scan.
  [[nodiscard]] std::optional<double> AgeOf(const std::string& scan_id) const;
  void StoreOpened(Store& store) override;
  void StorageFailed() override;
  void StorageFaultChanged() override { PublishState(); }
  void StorageWorks() override;
  void ReadAll() override;
  [[nodiscard]] bool HasSession() const override { return session_.IsOpen(); }
  void WatchSpace();
  /// @param actor  Who asks for it; null: the appliance itself.
  Answer Handle(ScanEvent event, const Actor* actor = nullptr);
  void Audit(const Actor& actor, const std::string& action, const std::string& subject,
             const Message& detail);
  /// Adds what a person did with the scan to the audit log.
  void AuditAct(ScanAction action, const Actor& actor);
  /// Purpose of the running or last scan by its stored name, or "unassigned".
  [[nodiscard]] std::string ScanKind() const;
  void OnSessionUnused();
  void ForgetSession();
  void NoteDropped(const ScanUpdate& update);
  void Act(ScanAction action);
  Answer WhyNotScan() const;
  [[nodiscard]] bool WantsWristband() const;
  Answer WhyNotSweep() const;
  void StartScan();
  Answer WhyNotMonitor() const;
  void StartMonitor();
  [[nodiscard]] MonitorJob MakeMonitorJob();
  [[nodiscard]] Message WhyNoRecord() const;
  void OnMonitorRecorded(const std::string& scan_id, const std::string& file);
  void EndMonitor();
  void OnMonitorFailed(const Message& why);
  void WatchRest();
  [[nodiscard]] bool PressMonitors() const;
  void FollowReference();
  void BeginScan();
  [[nodiscard]] ScanJob MakeJob(const Settings& settings);
  /// Whether a stored scene is as it was stored; on the thread that uses it.
  [[nodiscard]] std::function<Message(const std::stop_token&)> SceneCheck(
      const std::string& scan) const;
  [[nodiscard]] ScanCallbacks MakeCheckCallbacks(const NewScan& scan);
  void AddListeners(ScanCallbacks& callbacks);
  [[nodiscard]] ScanCallbacks MakeCallbacks(const NewScan& scan);
  void OnSensor(const SensorEvent& event);
  void NoteSensor(const SensorEvent& event);
  void LogSensor(const SensorEvent& event);
  void OnUpdate(const ScanUpdate& update);
  void OnEnded(const EndedScan& outcome);
  void Count(const EndedScan& outcome);
  void OnTick();
  void LookForMessages();
  void TellPeers();
  void OnPeers(const Message& found);
  [[nodiscard]] std::uint64_t NeededBytes() const;
  [[nodiscard]] Answer WhyFull() const;
  [[nodiscard]] Answer WhyNoSpace() const;
  [[nodiscard]] std::vector<Message> StorageWarnings() const {
    return upkeep_.Warnings(!parts_.demo_patient.empty());
  }
  void ReadStored(Status& status);
  void ReadStoredOrFail(Status& status);
  void Show();
  [[nodiscard]] IndicatorPattern Pattern() const;
  void PublishState();
  [[nodiscard]] Message FaultReason() const;

  EventLoop& loop_;
  ApplianceParts& parts_;
  Notices& notices_;
  StorageWatch& storage_;
  const CurrentStore& store_;
  StorageUpkeep& upkeep_;
  RoomInUse& room_;
  UnitProfiles& profiles_;
  ReferenceGate& references_;
  CurrentSession& session_;
  WorkThread& store_thread_;
  LiveMonitoring& monitoring_;
  MessagesOut& messages_;
  PeerWatch& peers_;
  const Message& not_archived_;
  SensorThread& sensors_;
  OutlineWatch& outline_;
  std::uint64_t followed_changes_ = 0;  ///< Notices::data_changes() at FollowReference().
  Message space_fault_;                 ///< Why no scan can be stored although the store works.
  ScanState state_;
  Message sensor_fault_, scan_fault_, rolled_back_;
  CurrentScan scan_;
  std::optional<CurrentScan> last_result_;
  ScanCounts counts_;                            ///< Since the start.
  std::string last_serial_;                      ///< Serial of the last used sensor.
  std::optional<SensorEvent> sensor_while_two_;  ///< The first one's, of two that monitor.
  PageNotes page_;
  int ticks_to_messages_ = 0;  ///< Until what needs a person is looked for.
  IndicatorPattern shown_ = IndicatorPattern::kOff;
  std::function<void()> stopped_;
  EventLoop::Source result_timer_, limit_timer_, tick_timer_;
  ButtonWatch button_;
  RestWatch rest_;
  Message monitor_end_;                   ///< Why monitoring ends; empty: somebody ends it.
  Message monitored_;                     ///< How it was, for the audit log.
  std::unique_ptr<ScanSession> running_;  // last: its thread uses the members above
};

}  // namespace plumb
