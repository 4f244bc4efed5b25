#include "daemon/appliance/appliance.hpp"

#include <sys/epoll.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "daemon/appliance/plan_options.hpp"
#include "daemon/files/scene_json.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/records/check_json.hpp"

namespace plumb {
namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::json;
using std::chrono::seconds;

constexpr seconds kTick{1};
constexpr std::chrono::minutes kSessionIdle{30};
constexpr double kDroppedSmoothing_s = 1.0;
const web::Actor kSelf{.user = "plumbd", .address = ""};
const web::Actor kAuto{.user = "auto", .address = ""};

double Milliseconds(Clock::duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

}  // namespace

Appliance::Appliance(EventLoop& loop, ApplianceParts parts)
    : loop_(loop),
      parts_(std::move(parts)),
      profiles_(std::make_shared<ProfileShelf>(parts_.config.appliance.state / "sensor-profiles")),
      profiles_off_(ProfilesOff(parts_.config)) {
  OpenStore();
  result_timer_ =
      loop_.MakeTimer("result expired", [this] { (void)Handle(ScanEvent::kResultExpired); });
  limit_timer_ = loop_.MakeTimer("longest sweep", [this] {
    Log(LogLevel::kNotice, "the longest sweep is over", {{"SCAN", scan_.id}});
    (void)Handle(ScanEvent::kSweepComplete);
  });
  session_timer_ = loop_.MakeTimer("session unused", [this] { OnSessionTimer(); });
  tick_timer_ = loop_.MakeTimer("tick", [this] { OnTick(); });
  tick_timer_.ArmAfter(kTick);
  if (!storage_fault_.empty()) (void)Handle(ScanEvent::kStorageFailed);
  WatchButton();
  Show();
  Care();
  sensors_ = std::make_unique<SensorThread>(
      parts_.make_provider,
      SensorThreadOptions{.serial = parts_.config.appliance.sensor_serial,
                          .before_scan = parts_.before_scan},
      [this](const SensorEvent& event) {
        loop_.Post("sensor", [this, event] { OnSensor(event); });
      });
}

Appliance::~Appliance() {
  care_.request_stop();
  session_.reset();
  sensors_.reset();
}

void Appliance::WatchButton() {
  if (parts_.button == nullptr) return;
  parts_.button->SetListener([this](ButtonPress press) { (void)Press(press); });
  const auto dispatch = [this] {
    try {
      parts_.button->Dispatch(Button::Clock::now());
      ArmButtonTimer();
    } catch (const DeviceError& error) {
      Log(LogLevel::kError, fmt::format("the button is gone: {}", error.what()));
      button_source_ = {};
    }
  };
  button_timer_ = loop_.MakeTimer("button", dispatch);
  button_source_ = loop_.WatchDescriptor("button", parts_.button->fd(), EPOLLIN,
                                         [dispatch](std::uint32_t) { dispatch(); });
  ArmButtonTimer();
}

void Appliance::ArmButtonTimer() {
  if (const auto deadline = parts_.button->deadline()) {
    button_timer_.ArmAt(*deadline);
  } else {
    button_timer_.Disarm();
  }
}

bool Appliance::IsRunning() const {
  return state_.phase == ScanPhase::kScanning || state_.phase == ScanPhase::kWorking;
}

/// The demo's, which is open from the start and stays.
bool Appliance::IsOwnSession() const { return opened_by_.user == kSelf.user; }

Appliance::Answer Appliance::WhyNotRestart() const {
  if (IsRunning())
    return fmt::format(
        "in state {}, trying to restart the machine, requires that no scan runs: wait for its "
        "result",
        Name(state_.phase));
  if (opening_ || (!session_id_.empty() && !IsOwnSession()))
    return "the session of a patient is open: close it first, then restart";
  return {};
}

/// A long press when nothing runs and no result is shown ends the treatment session.
Appliance::Answer Appliance::Press(ButtonPress press) {
  if (press == ButtonPress::kLong && state_.phase == ScanPhase::kReady && !session_id_.empty() &&
      !IsOwnSession())
    return CloseSession({.user = "button", .address = {}});
  return Handle(press == ButtonPress::kShort ? ScanEvent::kShortPress : ScanEvent::kLongPress);
}

Appliance::Answer Appliance::StartSweep() { return Handle(ScanEvent::kStart); }
Appliance::Answer Appliance::EndSweep() { return Handle(ScanEvent::kEndSweep); }
Appliance::Answer Appliance::Cancel() { return Handle(ScanEvent::kCancel); }

/// What only the appliance knows; the state has said yes already.
Appliance::Answer Appliance::WhyNotScan() const {
  if (stopped_) return "the appliance is being switched off";
  if (std::string hindrance = hindrance_ ? hindrance_() : std::string(); !hindrance.empty())
    return hindrance;
  if (store_ == nullptr || !storage_fault_.empty()) return "nothing can be stored";
  if (opening_) return "a patient is being opened: press again in a moment";
  return WhyNoSpace();
}

Appliance::Answer Appliance::Handle(ScanEvent event) {
  const ScanState before = state_;
  ScanTransition transition = Next(state_, event);
  const bool starts = std::find(transition.actions.begin(), transition.actions.end(),
                                ScanAction::kStartScan) != transition.actions.end();
  Answer answer(transition.refusal);
  if (starts) {
    answer = WhyNotScan();
    if (!answer.empty())
      transition = {.state = before, .actions = {ScanAction::kRefuse}, .refusal = {}};
  }
  if (!answer.empty()) {
    Log(LogLevel::kNotice,
        fmt::format("{} ignored in state {}: {}", Name(event), Name(before.phase), answer));
    TellEvent("ignored",
              Json{{"what", Name(event)}, {"state", Name(before.phase)}, {"reason", answer}}.dump(
                  -1, ' ', false, Json::error_handler_t::replace));
  }
  state_ = transition.state;
  if (state_.phase != ScanPhase::kResult) result_timer_.Disarm();
  for (const ScanAction action : transition.actions) Act(action);
  if (state_ != before) TellState();
  return answer;
}

void Appliance::Act(ScanAction action) {
  switch (action) {
    case ScanAction::kStartScan:
      return StartScan();
    case ScanAction::kEndSweep:
      limit_timer_.Disarm();
      scan_.images = sensors_->snapshot().statistics.Since(scan_.sensor_before);
      return sensors_->EndScan();
    case ScanAction::kCancelScan:
      limit_timer_.Disarm();
      scan_.cancelled_at = Clock::now();
      if (session_) session_->Cancel();
      return sensors_->EndScan();
    case ScanAction::kArmResultTimer:
      return result_timer_.ArmAfter(std::chrono::microseconds(
          static_cast<std::int64_t>(parts_.config.appliance.result_s * 1e6)));
    case ScanAction::kRefuse:
      return;
  }
}

void Appliance::StartScan() {
  try {
    BeginSession();
  } catch (const std::exception& error) {
    scan_fault_ = fmt::format("the scan could not begin: {}", error.what());
    Log(LogLevel::kError, scan_fault_);
    loop_.Post("scan failed", [this] { (void)Handle(ScanEvent::kScanFailed); });
  }
}

void Appliance::BeginSession() {
  const web::Settings settings = store_->GetSettings();
  session_.reset();  // the last one has ended
  scan_ = {};
  scan_.patient_id = check_ ? std::string() : open_patient_;
  scan_.purpose = check_ ? web::ScanPurpose::kDailyCheck : purpose_;
  scan_.started = Clock::now();
  ScanJob job = MakeJob(settings);
  if (job.is_reference) {
    if (const std::string why = WhyNoReference(); !why.empty()) throw DataError(why);
  }
  const NewScan record{.patient_id = scan_.patient_id,
                       .reference_id = scan_.reference_id,
                       .purpose = scan_.purpose,
                       .sensor_serial = sensors_->snapshot().sensor.serial,
                       .reason = reference_reason_,
                       .session_id = check_ ? std::string() : session_id_,
                       .sensor_on_s = SecondsSinceSensor(),
                       .check_overdue = IsCheckOverdue()};
  scan_.sensor_before = sensors_->snapshot().statistics;
  ArmSessionTimer();
  session_ = std::make_unique<ScanSession>(
      std::move(job), check_ ? MakeCheckCallbacks(record) : MakeCallbacks(record));
  sensors_->BeginScan(session_->feed());
  limit_timer_.ArmAfter(std::chrono::microseconds(static_cast<std::int64_t>(
      parts_.config.appliance.scan_limit_s.value_or(settings.scan_limit_s) * 1e6)));
}

ScanJob Appliance::MakeJob(const web::Settings& settings) {
  ScanJob job;
  job.info = sensors_->snapshot().info;
  job.reconstructor = parts_.config.reconstruct;
  job.reconstructor.keep_color = false;  // of a patient only the shape is kept
  job.keep_recording = parts_.config.appliance.keep_recordings || settings.keep_recordings;
  job.unit_profile = MakeUnitProfile();
  job.stop_after_s = parts_.config.appliance.auto_stop_s.value_or(settings.auto_stop_s);
  if (check_) {
    job.keep_recording = false;
    const std::string baseline = store_->CheckBaselineJson();
    job.check = CheckJob{BaselineIn(baseline), parts_.config.check};
    if (!baseline.empty() && !job.check->baseline)
      throw DataError("the stored baseline of the daily check cannot be read: set another one");
    return job;
  }
  if (scan_.patient_id.empty()) return job;  // no session is open: compared with nothing
  const std::optional<web::Reference> reference = store_->ApprovedReference(scan_.patient_id);
  if (reference) scan_.reference_area_m2 = store_->SweptArea(reference->scan_id);
  if (!reference && scan_.purpose == web::ScanPurpose::kFraction)
    scan_.purpose = web::ScanPurpose::kReference;
  job.is_reference = scan_.purpose == web::ScanPurpose::kReference;
  if (reference && scan_.purpose == web::ScanPurpose::kFraction) {
    scan_.reference_id = reference->id;
    job.reference_scene = store_->ScanFolder(reference->scan_id) / "scene";
    job.check_reference = [this, scan = reference->scan_id](const std::stop_token& stop) {
      return store_->CheckFiles(scan, /*scene_only=*/true, stop);
    };
    job.compare = CompareOptionsFor(reference->plan, parts_.config.compare);
    job.compare.now_s = SteadySeconds;
  }
  return job;
}

web::ReferencePlan Appliance::DefaultPlan() {
  const web::Settings settings = store_ ? store_->GetSettings() : web::Settings{};
  return {.region_m = {},
          .isocentre_m = {},
          .tolerance = settings.tolerance,
          .posture = settings.posture,
          .couch_markers = settings.couch_markers};
}

/// They run on the scan's thread: they use the store, which is thread-safe, and copies; everything
/// else is posted.
ScanCallbacks Appliance::MakeCallbacks(const NewScan& record) {
  ScanCallbacks callbacks;
  auto id = std::make_shared<std::string>();
  callbacks.begin = [this, record, id] {
    *id = store_->BeginScan(record);
    loop_.Post("scan begun", [this, id] { scan_.id = *id; });
    return store_->StagingFolder(*id);
  };
  const bool is_demo =
      !parts_.demo_patient.empty() && record.purpose == web::ScanPurpose::kReference;
  const web::ReferencePlan plan = DefaultPlan();
  const bool is_reference = record.purpose == web::ScanPurpose::kReference;
  callbacks.save = [this, id, plan, is_demo, is_reference, reason = record.reason,
                    actor = opened_by_, patient = record.patient_id](const ScanOutcome& outcome) {
    if (id->empty()) return;  // it never began
    using Kind = ScanOutcome::Kind;
    FinishedScan finished{.failure = outcome.reason,
                          .result_json = outcome.result_json,
                          .swept_area_m2 = outcome.swept_area_m2};
    if (outcome.kind == Kind::kDone) finished.outcome = web::ScanOutcome::kDone;
    if (outcome.kind == Kind::kCancelled) finished.outcome = web::ScanOutcome::kCancelled;
    store_->FinishScan(*id, finished);
    const auto demo = store_->FindPatientByCode(parts_.demo_patient);
    if (!is_reference || outcome.kind != Kind::kDone) return;
    if (!is_demo || !demo || demo->id != patient || !demo->approved_reference_id.empty()) {
      (void)store_->AddReference(actor, *id, reason, plan);  // a draft, for a physicist to plan
      return;
    }
    store_->ApproveReference(kAuto,
                             store_->AddReference(kAuto, *id, "first scan of the demo", plan),
                             /*revision=*/1, /*digest=*/{}, /*two_users=*/false);
  };
  AddListeners(callbacks);
  return callbacks;
}

void Appliance::AddListeners(ScanCallbacks& callbacks) {
  callbacks.update = [this](const ScanUpdate& update) {
    loop_.Post("scan progress", [this, update] { OnUpdate(update); });
  };
  callbacks.sweep_complete = [this] {
    loop_.Post("sweep complete", [this] { (void)Handle(ScanEvent::kSweepComplete); });
  };
  callbacks.ended = [this](const ScanOutcome& outcome) {
    loop_.Post("scan ended", [this, outcome] { OnEnded(outcome); });
  };
}

/// Nothing of a check is kept but its numbers.
ScanCallbacks Appliance::MakeCheckCallbacks(const NewScan& record) {
  ScanCallbacks callbacks;
  callbacks.begin = [] { return std::filesystem::path(); };
  callbacks.save = [this, actor = *check_,
                    serial = record.sensor_serial](const ScanOutcome& outcome) {
    if (!outcome.check_json.empty()) (void)store_->AddCheck(actor, serial, outcome.check_json);
  };
  AddListeners(callbacks);
  return callbacks;
}

Appliance::Answer Appliance::OpenCheck(const web::Actor& actor) {
  if (IsRunning()) {
    return fmt::format(
        "in state {}, trying to begin a check, requires that no scan runs: wait for its result",
        Name(state_.phase));
  }
  check_ = actor;
  TellWeb(web::EventKind::kStatus);
  return {};
}

void Appliance::OnSensor(const SensorEvent& event) {
  LogSensor(event);
  const char* kNames[] = {"ready", "lost", "failed", "others", "stalled"};
  TellEvent("sensor", Json{{"what", kNames[static_cast<int>(event.kind)]},
                           {"serial", event.sensor.serial},
                           {"reason", event.reason},
                           {"others", event.others}}
                          .dump(-1, ' ', false, Json::error_handler_t::replace));
  TellWeb(web::EventKind::kStatus);
  if (event.kind == SensorEvent::Kind::kOthers || event.kind == SensorEvent::Kind::kStalled) return;
  sensor_fault_ = event.reason;
  (void)Handle(event.kind == SensorEvent::Kind::kReady  ? ScanEvent::kSensorReady
               : event.kind == SensorEvent::Kind::kLost ? ScanEvent::kSensorLost
                                                        : ScanEvent::kSensorFailed);
}

void Appliance::LogSensor(const SensorEvent& event) {
  const std::string& serial = event.sensor.serial;
  if (event.kind == SensorEvent::Kind::kLost) Log(LogLevel::kNotice, "no sensor is attached");
  if (event.kind == SensorEvent::Kind::kFailed)
    Log(LogLevel::kError, fmt::format("the sensor does not work: {}", event.reason),
        {{"SERIAL", serial}});
  if (event.kind == SensorEvent::Kind::kStalled)
    Log(LogLevel::kWarning, event.reason, {{"SERIAL", serial}});
  if (event.kind == SensorEvent::Kind::kReady) {
    sensor_since_ = Clock::now();
    Log(LogLevel::kInfo, "the sensor is ready", {{"SERIAL", serial}});
    if (const std::string why = WhyNoProfile(event.sensor); !why.empty())
      Log(LogLevel::kNotice, fmt::format("no profile is kept of this sensor: {}", why),
          {{"SERIAL", serial}});
    const StreamInfo info = sensors_->snapshot().info;
    if (!last_serial_.empty() && last_serial_ != serial) {
      Log(LogLevel::kNotice,
          fmt::format("another sensor than before: {} instead of {}, {}", serial, last_serial_,
                      info.intrinsics_assumed ? "not calibrated" : "with its own calibration"));
    }
    last_serial_ = serial;
    for (const std::string& warning : info.warnings)
      Log(LogLevel::kWarning, warning, {{"SERIAL", serial}});
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

void Appliance::OnUpdate(const ScanUpdate& update) {
  if (scan_.has_ended) return;
  if (update.frames > 0 && scan_.update.frames == 0)
    scan_.first_frame_ms = Milliseconds(Clock::now() - scan_.started);
  NoteDropped(update);
  scan_.update = update;
  Show();
  TellProgress();
  TellWeb(web::EventKind::kProgress);
}

/// Updates come at most ten times a second.
void Appliance::NoteDropped(const ScanUpdate& update) {
  const double lost = static_cast<double>(update.frames_dropped - scan_.update.frames_dropped);
  const double seen = static_cast<double>(update.frames - scan_.update.frames);
  if (lost + seen <= 0) return;
  const double weight = 1.0 - std::exp(-(lost + seen) / (30.0 * kDroppedSmoothing_s));
  scan_.dropped_share += weight * (lost / (lost + seen) - scan_.dropped_share);
}

void Appliance::OnEnded(const ScanOutcome& outcome) {
  using Kind = ScanOutcome::Kind;
  limit_timer_.Disarm();
  sensors_->EndScan();
  // Its thread has nothing left to do, but its end may wait for a processor.
  (void)store_thread_.Post(
      [ended = std::shared_ptr<ScanSession>(std::move(session_))]() mutable { ended.reset(); });
  ArmSessionTimer();
  scan_.has_ended = true;
  scan_.ended = Clock::now();
  scan_.outcome = outcome;
  if (outcome.kind == Kind::kCancelled) {
    scan_.cancel_ms = Milliseconds(Clock::now() - scan_.cancelled_at);
    Log(LogLevel::kNotice, fmt::format("the scan was discarded within {:.0f} ms", scan_.cancel_ms),
        {{"SCAN", scan_.id}});
    (void)Handle(ScanEvent::kScanCancelled);
  } else if (outcome.kind == Kind::kFailed) {
    scan_fault_ = fmt::format("the scan failed: {}", outcome.reason);
    Log(LogLevel::kError, scan_fault_, {{"SCAN", scan_.id}});
    (void)Handle(ScanEvent::kScanFailed);
    CheckDisk();
  } else {
    if (state_.cancelling)
      Log(LogLevel::kNotice, "the scan was stored before it could be discarded: its result stands",
          {{"SCAN", scan_.id}});
    const bool is_check = scan_.purpose == web::ScanPurpose::kDailyCheck;
    if (!is_check) last_result_ = scan_;
    if (scan_.purpose == web::ScanPurpose::kReference &&
        outcome.kind == Kind::kDone) {  // the next one is compared with it, once it is approved
      purpose_ = web::ScanPurpose::kFraction;
      reference_reason_.clear();
    }
    const std::string answer = is_check ? "daily check " + CheckIn(outcome.check_json).status
                               : outcome.verdict                ? Name(*outcome.verdict)
                               : outcome.kind == Kind::kNoScene ? outcome.reason
                                                                : "no comparison";
    Log(LogLevel::kInfo,
        fmt::format("the scan is done {:.2f} s after its last frame, {} frames, {} dropped: {}",
                    outcome.after_last_frame_s, outcome.frames, outcome.frames_dropped, answer),
        {{"SCAN", scan_.id}});
    const SensorStatistics& images = scan_.images;
    if (images.num_lost + images.num_unpaired + images.num_discarded > 0) {
      Log(LogLevel::kWarning,
          fmt::format("of the sensor's images {} were lost, {} without a partner, {} of a wrong "
                      "size, twice or out of order",
                      images.num_lost, images.num_unpaired, images.num_discarded),
          {{"SCAN", scan_.id}});
    }
    (void)Handle(ScanEvent::kScanDone);
    TellEvent("result", Json{{"scan", scan_.id}, {"answer", answer}}.dump(
                            -1, ' ', false, Json::error_handler_t::replace));
  }
  if (outcome.kind == Kind::kDone) profile_fault_ = outcome.drift;
  check_.reset();
  TellWeb(web::EventKind::kResult);
  TellWeb(web::EventKind::kData);
  Care();
  if (stopped_) std::exchange(stopped_, nullptr)();
}

void Appliance::OpenSession(const std::string& session_id, const std::string& patient_id,
                            web::ScanPurpose purpose, const std::string& reason,
                            const web::Actor& actor) {
  session_id_ = session_id;
  open_patient_ = patient_id;
  opened_by_ = actor;
  check_.reset();
  purpose_ = purpose;
  reference_reason_ = reason;
  ArmSessionTimer();
  TellWeb(web::EventKind::kStatus);
}

void Appliance::ForgetSession() {
  session_id_.clear();
  open_patient_.clear();
  reference_reason_.clear();
  purpose_ = web::ScanPurpose::kFraction;
  session_timer_.Disarm();
  TellWeb(web::EventKind::kStatus);
}

Appliance::Answer Appliance::CloseSession(const web::Actor& actor) {
  if (IsRunning())
    return fmt::format(
        "in state {}, trying to close the session, requires that no scan runs: wait for its result",
        Name(state_.phase));
  if (session_id_.empty()) return "no session is open";
  ForgetSession();
  (void)store_thread_.Post([this, actor] {
    try {
      store_->CloseSessions(actor);
    } catch (const std::exception& error) {
      Log(LogLevel::kError, fmt::format("cannot note the end of the session: {}", error.what()));
    }
    loop_.Post("session closed", [this] { TellWeb(web::EventKind::kData); });
  });
  return {};
}

/// The demo's session does not expire: there is no user who could open it again.
void Appliance::ArmSessionTimer() {
  if (session_id_.empty() || opened_by_.user == kSelf.user) return session_timer_.Disarm();
  session_timer_.ArmAfter(kSessionIdle);
}

void Appliance::OnSessionTimer() {
  if (IsRunning()) return ArmSessionTimer();
  Log(LogLevel::kNotice, "the session was closed: nothing was scanned for 30 minutes");
  (void)CloseSession(kSelf);
}

void Appliance::ClosePatient(const std::string& patient_id) {
  if (open_patient_ == patient_id) ForgetSession();
}

void Appliance::Reload(const Config& config) {
  Config next = config;
  const std::vector<std::string> kept = KeepUntilRestart(parts_.config, next);
  parts_.config = std::move(next);
  profiles_off_ = ProfilesOff(parts_.config);
  Log(LogLevel::kInfo, "the configuration was read again");
  if (!kept.empty())
    Log(LogLevel::kWarning,
        fmt::format("changed, but in use only after a restart: {}", fmt::join(kept, ", ")));
}

void Appliance::Stop(std::function<void()> stopped) {
  care_.request_stop();
  if (!IsRunning()) {
    stopped();
    stopped_ = [] {};
    return;
  }
  stopped_ = std::move(stopped);
  if (!state_.cancelling) (void)Handle(ScanEvent::kCancel);
}

void Appliance::OnTick() {
  tick_timer_.ArmAfter(kTick);
  const bool is_running = IsRunning();
  clock_.Look(std::chrono::system_clock::now(), Clock::now());
  if (!is_running && --ticks_to_disk_check_ <= 0) CheckDisk();
  if (!is_running && --ticks_to_care_ <= 0) Care();
  if (!is_running && --ticks_to_file_check_ <= 0) CheckStoredFiles();
  if (!is_running && --ticks_to_backup_ <= 0) BackUpIfDue();
  if (parts_.button != nullptr && button_source_.is_armed()) ArmButtonTimer();
}

bool Appliance::WorkersAreAlive() const {
  const double now_s = SteadySeconds();
  if (now_s - sensors_->heartbeat_s() > parts_.sensor_silence_s) return false;
  // While sweeping the scan's thread waits for frames; that frames come is the sensor thread's
  // matter.
  const bool is_working = state_.phase == ScanPhase::kWorking && session_ != nullptr;
  return !is_working || now_s - session_->heartbeat_s() < parts_.worker_silence_s;
}

}  // namespace plumb
