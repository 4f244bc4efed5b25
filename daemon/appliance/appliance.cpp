// SPDX-License-Identifier: Apache-2.0
#include "daemon/appliance/appliance.hpp"

#include <algorithm>
#include <exception>
#include <map>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "daemon/appliance/control_lines.hpp"
#include "daemon/database/stored_values.hpp"
#include "daemon/loop/log.hpp"
#include "words/audit.hpp"
#include "words/monitoring.hpp"
#include "words/scan.hpp"

namespace plumb {
namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::json;

const Actor kButton{.user = "button", .address = ""};

/// {"appliance.quota_gb": [null, "50"], "web.listen": ["'a'", "'b'", "restart"]}: before and after,
/// null for the default. @param kept  The keys that take effect only after a restart.
Json ConfigChanges(const Config& before, const Config& after,
                   const std::vector<std::string>& kept) {
  std::map<std::string, std::string> keys = before.given;
  keys.insert(after.given.begin(), after.given.end());
  Json changes = Json::object();
  for (const auto& [key, unused] : keys) {
    const auto value = [&name = key](const Config& config) {
      const auto given = config.given.find(name);
      return given == config.given.end() ? Json(nullptr) : Json(given->second);
    };
    if (value(before) == value(after)) continue;
    changes[key] = {value(before), value(after)};
    if (std::find(kept.begin(), kept.end(), key) != kept.end()) changes[key].push_back("restart");
  }
  return changes;
}

}  // namespace

Appliance::Appliance(SharedParts& shared)
    : loop_(shared.loop),
      parts_(shared.given),
      notices_(shared.notices),
      storage_(shared.storage),
      store_(shared.store),
      upkeep_(shared.upkeep),
      room_(shared.room),
      profiles_(shared.profiles),
      references_(shared.references),
      session_(shared.session),
      store_thread_(shared.store_thread),
      monitoring_(shared.monitoring),
      messages_(shared.messages),
      peers_(shared.peers),
      not_archived_(shared.not_archived),
      sensors_(shared.sensors),
      outline_(shared.outline),
      button_(loop_, parts_.button, [this](ButtonPress press) { (void)Press(press, kButton); }),
      rest_(loop_, sensors_, [this] { PublishState(); }) {
  shared.sensor_changed = [this](const SensorEvent& event) { OnSensor(event); };
  shared.peers_changed = [this](const Message& found) { OnPeers(found); };
  shared.session_unused = [this] { OnSessionUnused(); };
  monitoring_.SetHooks(
      {.ask =
           [this](bool starts, const Actor& actor) {
             return Handle(starts ? ScanEvent::kMonitorStart : ScanEvent::kMonitorStop, &actor);
           },
       .changed = [this] { Show(); },
       .failed = [this](const Message& why) { OnMonitorFailed(why); },
       .recorded = [this](const std::string& scan_id,
                          const std::string& file) { OnMonitorRecorded(scan_id, file); }});
  storage_.Open(*this);
  room_.Refresh();
  result_timer_ =
      loop_.MakeTimer("result expired", [this] { (void)Handle(ScanEvent::kResultExpired); });
  limit_timer_ = loop_.MakeTimer("longest sweep", [this] {
    Log(LogLevel::kNotice, "the sweep has reached its longest duration", {{"SCAN", scan_.id}});
    (void)Handle(ScanEvent::kSweepComplete);
  });
  tick_timer_ = loop_.MakeTimer("tick", [this] { OnTick(); });
  tick_timer_.ArmAfter(parts_.tick);
  if (!storage_.fault().empty()) (void)Handle(ScanEvent::kStorageFailed);
  Show();
  upkeep_.Run();
  WatchSpace();
}

Appliance::~Appliance() {
  upkeep_.Stop();
  (void)monitoring_.End({});
  monitoring_.SetHooks({});
  running_.reset();
}

bool Appliance::IsRunning() const {
  return state_.phase == ApplianceState::kScanning || state_.phase == ApplianceState::kWorking;
}

Appliance::Answer Appliance::WhyNotIdle() const {
  if (state_.phase == ApplianceState::kMonitoring) return say::monitoring::RunsAlready();
  return IsRunning() ? say::scan::WaitForResult() : Message();
}

/// Without a running scan and a shown result, a long press ends what the screens say is in hand: a
/// daily check that was opened, else the treatment session. A short one starts monitoring where the
/// sensor is at rest, as light and screens have said before.
Appliance::Answer Appliance::Press(ButtonPress press, const Actor& actor) {
  if (press == ButtonPress::kLong && state_.phase == ApplianceState::kReady && session_.check())
    return PrepareCheck(/*opens=*/false, actor);
  if (press == ButtonPress::kLong && state_.phase == ApplianceState::kReady && session_.IsOpen() &&
      session_.IsPatients())
    return CloseSession(actor);
  if (press == ButtonPress::kShort && PressMonitors())
    return Handle(ScanEvent::kMonitorStart, &actor);
  return Handle(press == ButtonPress::kShort ? ScanEvent::kShortPress : ScanEvent::kLongPress,
                &actor);
}

Appliance::Answer Appliance::StartSweep(const Actor& actor) {
  return Handle(ScanEvent::kStart, &actor);
}
Appliance::Answer Appliance::EndSweep(const Actor& actor) {
  return Handle(ScanEvent::kEndSweep, &actor);
}
Appliance::Answer Appliance::Cancel(const Actor& actor) {
  return Handle(ScanEvent::kCancel, &actor);
}

/// Checks beyond the state, which has accepted the event already.
Appliance::Answer Appliance::WhyNotScan() const {
  if (stopped_) return say::scan::SwitchingOff();
  if (Message why = session_.WhyBlocked(); !why.empty()) return why;
  if (!storage_.IsUsable()) return say::scan::NothingStored();
  if (Message why = store_->WhyOtherScans(); !why.empty()) return why;
  if (Message why = session_.WhyNotScan(); !why.empty()) return why;
  return WhyNoSpace();
}

bool Appliance::WantsWristband() const {
  return session_.LacksWristband(Clock::now()) && store_->settings.Get().scan_wristband;
}

/// Settings that cannot be read might ask for the wristband.
Appliance::Answer Appliance::WhyNotSweep() const {
  if (Message why = WhyNotScan(); !why.empty()) return why;
  try {
    return WantsWristband() ? say::scan::WristbandFirst() : Message();
  } catch (const std::exception& error) {
    return MessageOf(error);
  }
}

Appliance::Answer Appliance::Handle(ScanEvent event, const Actor* actor) {
  const ScanState before = state_;
  ScanTransition transition = Next(state_, event);
  const bool starts = std::find(transition.actions.begin(), transition.actions.end(),
                                ScanAction::kStartScan) != transition.actions.end();
  Answer answer = transition.refusal;
  if (!answer.empty() && before.fault == FaultKind::kStorage && !space_fault_.empty())
    answer = space_fault_;
  const bool monitors = std::find(transition.actions.begin(), transition.actions.end(),
                                  ScanAction::kStartMonitor) != transition.actions.end();
  if (starts || monitors) {
    answer = starts ? WhyNotSweep() : WhyNotMonitor();
    if (starts && answer.empty()) session_.UseUpWristband();
    if (!answer.empty())
      transition = {.state = before, .actions = {ScanAction::kRefuse}, .refusal = {}};
  }
  if (!answer.empty()) {
    Log(LogLevel::kNotice, fmt::format("{} ignored in state {}: {}", Name(event),
                                       Name(before.phase), answer.English()));
    notices_.TellWatchers(IgnoredEvent(event, before.phase, answer));
  }
  if (before.phase == ApplianceState::kMonitoring &&
      (event == ScanEvent::kSensorLost || event == ScanEvent::kSensorFailed))
    monitor_end_ = event == ScanEvent::kSensorLost ? say::monitoring::SensorLost() : sensor_fault_;
  state_ = transition.state;
  if (state_.phase != ApplianceState::kResult) result_timer_.Disarm();
  for (const ScanAction action : transition.actions) {
    Act(action);
    if (actor != nullptr || action == ScanAction::kEndMonitor)
      AuditAct(action, actor != nullptr ? *actor : kSelf);
  }
  if (actor != nullptr && transition.actions.empty())  // a fault or a result was acknowledged
    Audit(*actor, "press", "", say::audit::State(Name(state_.phase)));
  if (state_ == before) return answer;
  WatchRest();
  PublishState();
  return answer;
}

void Appliance::AuditAct(ScanAction action, const Actor& actor) {
  switch (action) {
    case ScanAction::kStartScan:
      return Audit(actor, "scan.start", scan_.session_id, say::audit::ScanKind(ScanKind()));
    case ScanAction::kEndSweep:
      return Audit(actor, "scan.end", scan_.session_id, say::audit::ScanKind(ScanKind()));
    case ScanAction::kCancelScan:
      return Audit(actor, "cancel", scan_.session_id, say::audit::ScanKind(ScanKind()));
    case ScanAction::kStartMonitor:
      return Audit(actor, "monitor.start", monitoring_.status().scan_id, {});
    case ScanAction::kEndMonitor:
      return Audit(actor, "monitor.stop", monitoring_.status().scan_id, monitored_);
    case ScanAction::kArmResultTimer:
    case ScanAction::kRefuse:
      return;
  }
}

void Appliance::Audit(const Actor& actor, const std::string& action, const std::string& subject,
                      const Message& detail) {
  const auto report = [action](std::string_view why) {
    Log(LogLevel::kError, fmt::format("cannot write '{}' to the audit log: {}", action, why));
  };
  if (store_ == nullptr) return report(storage_.fault().English());
  const bool posted = store_thread_.Post([=, this, &store = store_, &loop = loop_] {
    try {
      store->audit.Log(actor, action, subject, detail);
    } catch (const std::exception& error) {
      return report(error.what());
    }
    loop.Post("audit log written", [this] { notices_.TellPage(web::EventKind::kData); });
  });
  if (!posted) report("the store is busy");
}

void Appliance::Act(ScanAction action) {
  switch (action) {
    case ScanAction::kStartScan:
      return StartScan();
    case ScanAction::kEndSweep:
      limit_timer_.Disarm();
      scan_.images = sensors_.snapshot().statistics.Since(scan_.sensor_before);
      return sensors_.EndScan();
    case ScanAction::kCancelScan:
      limit_timer_.Disarm();
      scan_.cancelled_at = Clock::now();
      if (running_) running_->Cancel();
      return sensors_.EndScan();
    case ScanAction::kArmResultTimer:
      return result_timer_.ArmAfterSeconds(parts_.result_s);
    case ScanAction::kStartMonitor:
      return StartMonitor();
    case ScanAction::kEndMonitor:
      return EndMonitor();
    case ScanAction::kRefuse:
      return;
  }
}

Appliance::Answer Appliance::PrepareCheck(bool opens, const Actor& actor) {
  if (Message why = WhyNotIdle(); !why.empty()) return why;
  if (!opens && !session_.check()) return say::scan::NoCheckOpen();
  session_.SetCheck(opens ? std::optional(actor) : std::nullopt);
  FollowReference();
  notices_.TellPage(web::EventKind::kStatus);
  if (!opens) Audit(actor, "check.leave", "", {});
  return {};
}

void Appliance::OnSensor(const SensorEvent& event) {
  LogSensor(event);
  notices_.TellWatchers(SensorChanged(event));
  notices_.TellPage(web::EventKind::kStatus);
  if (event.kind == SensorEvent::Kind::kOthers || event.kind == SensorEvent::Kind::kStalled) return;
  // Monitoring by two sensors goes on without the first one, and says so itself.
  if (state_.phase == ApplianceState::kMonitoring &&
      !parts_.config.appliance.second_sensor_serial.empty()) {
    sensor_while_two_ = event;
    return;
  }
  NoteSensor(event);
}

void Appliance::NoteSensor(const SensorEvent& event) {
  sensor_fault_ = event.reason;
  (void)Handle(event.kind == SensorEvent::Kind::kReady  ? ScanEvent::kSensorReady
               : event.kind == SensorEvent::Kind::kLost ? ScanEvent::kSensorLost
                                                        : ScanEvent::kSensorFailed);
}

void Appliance::LogSensor(const SensorEvent& event) {
  const std::string& serial = event.sensor.serial;
  if (event.kind == SensorEvent::Kind::kLost) Log(LogLevel::kNotice, "no sensor is attached");
  if (event.kind == SensorEvent::Kind::kFailed)
    Log(LogLevel::kError, fmt::format("the sensor does not work: {}", event.reason.English()),
        {{"SERIAL", serial}});
  if (event.kind == SensorEvent::Kind::kStalled)
    Log(LogLevel::kWarning, event.reason.English(), {{"SERIAL", serial}});
  if (event.kind == SensorEvent::Kind::kReady) {
    references_.SensorReady();
    Log(LogLevel::kInfo, "the sensor is ready", {{"SERIAL", serial}});
    if (const Message why = profiles_.WhyNone(event.sensor); !why.empty())
      Log(LogLevel::kNotice, fmt::format("no profile is kept of this sensor: {}", why.English()),
          {{"SERIAL", serial}});
    const StreamInfo info = sensors_.snapshot().info;
    if (!last_serial_.empty() && last_serial_ != serial) {
      Log(LogLevel::kNotice,
          fmt::format("another sensor than before: {} instead of {}, {}", serial, last_serial_,
                      info.intrinsics_assumed ? "not calibrated" : "with its own calibration"));
    }
    last_serial_ = serial;
    for (const Message& warning : info.warnings)
      Log(LogLevel::kWarning, warning.English(), {{"SERIAL", serial}});
  }
  const bool has_others = event.kind == SensorEvent::Kind::kReady && !event.others.empty();
  if (!has_others && event.kind != SensorEvent::Kind::kOthers) return;
  Log(LogLevel::kNotice,
      event.others.empty()
          ? fmt::format("only the sensor {} is attached now", serial)
          : fmt::format(
                "{} sensors are attached: {} is used, {} not; appliance.sensor_serial chooses",
                event.others.size() + 1, serial, fmt::join(event.others, ", ")));
}

void Appliance::OpenSession(const std::string& session_id, const std::string& patient_id,
                            ScanPurpose purpose, const std::string& reason, const Actor& actor) {
  if (monitoring_.IsActive()) (void)Handle(ScanEvent::kMonitorStop, &actor);
  session_.Open(session_id, patient_id, purpose, reason, actor);
  FollowReference();
  notices_.TellPage(web::EventKind::kStatus);
}

void Appliance::ForgetSession() {
  if (monitoring_.IsActive()) (void)Handle(ScanEvent::kMonitorEnded);
  session_.Forget();
  FollowReference();
  notices_.TellPage(web::EventKind::kStatus);
}

Appliance::Answer Appliance::CloseSession(const Actor& actor) {
  if (monitoring_.IsActive()) (void)Handle(ScanEvent::kMonitorStop, &actor);
  if (Message why = WhyNotIdle(); !why.empty()) return why;
  if (Message why = session_.WhyNotChange(); !why.empty()) return why;
  if (!session_.IsOpen()) return say::scan::NoSession();
  ForgetSession();
  (void)store_thread_.Post([this, actor, &store = store_, &loop = loop_] {
    try {
      store->treatments.CloseAll(actor);
    } catch (const std::exception& error) {
      Log(LogLevel::kError, fmt::format("cannot note the end of the session: {}", error.what()));
    }
    loop.Post("session closed", [this] { notices_.TellPage(web::EventKind::kData); });
  });
  return {};
}

void Appliance::OnSessionUnused() {
  if (IsRunning() || monitoring_.IsActive() || !session_.WhyNotChange().empty())
    return session_.ArmTimer();
  Log(LogLevel::kNotice, fmt::format("the session was closed: nothing was scanned for {:g} minutes",
                                     parts_.config.appliance.session_idle_min));
  (void)CloseSession(kSelf);
}

void Appliance::ClosePatient(const std::string& patient_id) {
  if (session_.patient_id() == patient_id) ForgetSession();
}

void Appliance::Reload(const Config& config) {
  Config next = config;
  const std::vector<std::string> kept = KeepUntilRestart(parts_.config, next);
  const Json changes = ConfigChanges(parts_.config, next, kept);
  parts_.config = std::move(next);
  profiles_.Configure(parts_.config);
  references_.Configure(parts_.config);
  room_.Refresh();
  Log(LogLevel::kInfo, "the configuration was read again");
  if (!changes.empty()) Audit(kSelf, "config.reload", "", Message::Verbatim(changes.dump()));
  if (!kept.empty())
    Log(LogLevel::kWarning,
        fmt::format("changed, but in use only after a restart: {}", fmt::join(kept, ", ")));
}

void Appliance::Stop(std::function<void()> stopped) {
  upkeep_.Stop();
  storage_.Stop();
  if (monitoring_.IsActive()) (void)Handle(ScanEvent::kMonitorEnded);
  if (!IsRunning()) {
    stopped();
    stopped_ = [] {};
    return;
  }
  stopped_ = std::move(stopped);
  if (!state_.cancelling) (void)Handle(ScanEvent::kCancel);
}

void Appliance::OnTick() {
  tick_timer_.ArmAfter(parts_.tick);
  WatchSpace();
  upkeep_.Tick(IsRunning());
  button_.Tick();
  WatchRest();
  // The reference of the session, and what is known of the room, are stored data.
  if (notices_.data_changes() != followed_changes_) FollowReference();
  LookForMessages();
  TellPeers();
}

/// Other units are not asked about the demo's patient, who does not exist.
void Appliance::TellPeers() {
  if (!peers_.IsSetUp() || store_ == nullptr || session_.id() == peers_.session()) return;
  std::string code;
  try {
    const std::optional<Patient> patient =
        session_.IsPatients() ? store_->patients.Find(session_.patient_id()) : std::nullopt;
    if (patient) code = patient->code;
  } catch (const std::exception& error) {
    return storage_.FailLater(error);
  }
  peers_.SetOpen(session_.id(), code);
}

void Appliance::OnPeers(const Message& found) {
  if (!found.empty()) Audit(kSelf, "session.elsewhere", session_.id(), found);
  notices_.TellPage(web::EventKind::kStatus);
}

void Appliance::LookForMessages() {
  constexpr int kMessageTicks = 30;
  if (!messages_.IsSetUp() || --ticks_to_messages_ > 0) return;
  ticks_to_messages_ = kMessageTicks;
  messages_.Look(WebStatus());
}

bool Appliance::WorkersAreAlive() const {
  const double now_s = SteadySeconds();
  if (now_s - sensors_.heartbeat_s() > parts_.sensor_silence_s) return false;
  // During the sweep the scan's thread waits for frames; their arrival is monitored by the sensor
  // thread.
  const bool is_working = state_.phase == ApplianceState::kWorking && running_ != nullptr;
  return !is_working || now_s - running_->heartbeat_s() < parts_.worker_silence_s;
}

void Appliance::StoreOpened(Store& store) {
  upkeep_.StoreOpened(store);
  const ApplianceConfig& given = parts_.config.appliance;
  if ((given.auto_stop_s || given.scan_limit_s || given.keep_recordings ||
       given.code_check_character) &&
      store.settings.AreSaved())
    Log(LogLevel::kNotice,
        "settings have been saved on the page: auto_stop_s, scan_limit_s, keep_recordings and "
        "code_check_character of plumb.toml no longer have an effect");
  if (parts_.demo_patient.empty()) return;
  const auto found = store.patients.FindByCode(parts_.demo_patient);
  const std::string patient =
      found ? found->id : store.patients.Add(kSelf, parts_.demo_patient, "");
  session_.Open(store.treatments.Open(kSelf, patient, ScanPurpose::kFraction), patient,
                ScanPurpose::kFraction, "", kSelf);
}

void Appliance::StorageFailed() {
  space_fault_ = {};
  (void)Handle(ScanEvent::kStorageFailed);
  PublishState();
}

void Appliance::StorageWorks() {
  (void)Handle(ScanEvent::kStorageWorks);
  WatchSpace();
  room_.Refresh();
  upkeep_.Run();
  notices_.TellPage(web::EventKind::kStatus);
  notices_.TellPage(web::EventKind::kData);
}

}  // namespace plumb
