// SPDX-License-Identifier: Apache-2.0
// Live monitoring as status, events, light and gate see it: what was said last, and how old it is.
#pragma once

#include <array>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "algo/base/message.hpp"
#include "daemon/appliance/current_scan.hpp"
#include "daemon/appliance/notices.hpp"
#include "daemon/loop/event_loop.hpp"
#include "daemon/loop/work_thread.hpp"
#include "daemon/monitoring/monitor_session.hpp"
#include "drivers/indicator.hpp"
#include "web/model/account.hpp"
#include "web/model/monitoring.hpp"

namespace plumb {

/// Used on the loop's thread.
class LiveMonitoring {
 public:
  /// What the appliance does for it.
  struct Hooks {
    std::function<Message(bool starts, const Actor& actor)> ask;  ///< Empty, or why not.
    std::function<void()> changed;                                ///< The light may have to change.
    std::function<void(const Message&)> failed;                   ///< It cannot go on.
    /// A record is complete: the scan and the file in its folder.
    std::function<void(const std::string& scan_id, const std::string& file)> recorded;
  };

  /// The arguments are borrowed. @param store_thread  Waits for the thread of an ended session.
  LiveMonitoring(EventLoop& loop, Notices& notices, WorkThread& store_thread);
  ~LiveMonitoring();
  LiveMonitoring(const LiveMonitoring&) = delete;
  LiveMonitoring& operator=(const LiveMonitoring&) = delete;

  void SetHooks(Hooks hooks) { hooks_ = std::move(hooks); }
  /// Each judged group of frames, ten times a second: whether it is `in`. See GateLine.
  void SetGate(std::function<void(bool is_in)> gate) { gate_ = std::move(gate); }

  /// For people and programs. @return Empty if it is done, otherwise why not.
  [[nodiscard]] Message Start(const Actor& actor) { return hooks_.ask(true, actor); }
  [[nodiscard]] Message Stop(const Actor& actor) { return hooks_.ask(false, actor); }

  /// The breath of the last second becomes the level of a hold. @return Why not; empty: it does.
  [[nodiscard]] Message TeachBreath(double width_mm, BreathHold& taught);
  [[nodiscard]] Message ForgetBreath();
  /// A person has signed this position: noted in the record and shown.
  void NoteAccepted(const AcceptedLive& accepted, const std::string& advice);

  /// For the appliance: frames go to the feed from now on.
  /// @param scan  Of the body. @param why_no_record  Why the job names no place for one; shown.
  void Begin(MonitorJob job, const std::shared_ptr<LiveFeed>& feed, const CurrentScan& scan,
             const Message& why_no_record = {});
  /// @param why  It could not go on; empty: it was ended. @return For the audit log.
  Message End(const Message& why);

  [[nodiscard]] bool IsActive() const { return session_ != nullptr; }
  [[nodiscard]] MonitorStatus status() const;
  /// As MonitoringService::MonitorMap().
  [[nodiscard]] std::shared_ptr<const std::string> Map() const;
  [[nodiscard]] IndicatorPattern Pattern() const;
  /// Of this or the last session; null without one. From any thread.
  [[nodiscard]] std::shared_ptr<const MonitorSession> Record() const;

 private:
  [[nodiscard]] MonitorCallbacks CallbacksOf(std::uint64_t epoch);
  void OnUpdate(const MonitorUpdate& update);
  void OnTick();
  void Tell();

  EventLoop& loop_;
  Notices& notices_;
  WorkThread& store_thread_;
  Hooks hooks_;
  std::function<void(bool)> gate_;
  std::string scan_id_, patient_id_;
  AcceptanceLimits limits_;
  bool judges_reference_ = false, is_recorded_ = false;
  std::vector<std::string> serials_;  ///< Of two sensors; empty with one.
  std::vector<Message> warnings_;
  std::optional<AcceptedLive> accepted_;
  Message ended_;
  double began_s_ = 0.0;
  std::optional<MonitorUpdate> last_;
  std::deque<double> latencies_s_;
  bool was_stale_ = false;
  std::uint64_t epoch_ = 0;  ///< Of the session: what an ended one has posted is not shown.
  EventLoop::Source tick_;
  std::shared_ptr<MonitorSession> session_;
  mutable std::mutex record_mutex_;
  std::shared_ptr<MonitorSession> recorded_;  ///< Guarded.
};

}  // namespace plumb
