// SPDX-License-Identifier: Apache-2.0
#include "daemon/appliance/live_monitoring.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include <nlohmann/json.hpp>

#include "algo/base/message_json.hpp"
#include "algo/base/statistics.hpp"
#include "algo/base/units.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/monitoring_files/monitoring_file.hpp"
#include "words/audit.hpp"
#include "words/monitoring.hpp"

namespace plumb {
namespace {

constexpr double kGrey_s = 0.2;
constexpr double kGone_s = 1.0;
constexpr std::chrono::milliseconds kLookAtAge{50};
constexpr std::size_t kLatencies = 100;

// From the order of couch::Component to that of kNumberAxes.
MotionNumbers NumbersOf(const LiveNumbers& numbers) {
  constexpr std::array<Eigen::Index, 6> kComponents = {2, 1, 0, 3, 4, 5};
  MotionNumbers shown;
  for (std::size_t i = 0; i < kComponents.size(); ++i) {
    const double unit = kNumberAxes[i].is_shift() ? kMillimetre : kDegree;
    shown.value[i] = numbers.value[kComponents[i]] / unit;
    shown.u95[i] = numbers.u95[kComponents[i]] / unit;
  }
  return shown;
}

// Of two sensors, one alone is used.
Message OneSensor(const std::vector<MonitorSensor>& sensors) {
  if (sensors.size() != 2) return {};
  const std::string used(Name(SensorShare::kUsed));
  if ((sensors[0].share == used) == (sensors[1].share == used)) return {};
  const bool is_first = sensors[0].share == used;
  const MonitorSensor& other = sensors[is_first ? 1 : 0];
  const std::string& left = sensors[is_first ? 0 : 1].serial;
  if (other.share == Name(SensorShare::kCovered))
    return say::monitoring::SensorCovered(other.serial, left);
  if (other.share == Name(SensorShare::kMoved))
    return say::monitoring::SensorPushed(other.serial, left);
  if (other.share == Name(SensorShare::kLeftOut))
    return say::monitoring::SensorLeftOut(other.serial, left);
  return say::monitoring::SensorSilent(other.serial, left);
}

}  // namespace

LiveMonitoring::LiveMonitoring(EventLoop& loop, Notices& notices, WorkThread& store_thread)
    : loop_(loop), notices_(notices), store_thread_(store_thread) {
  tick_ = loop_.MakeTimer("monitoring", [this] { OnTick(); });
}

LiveMonitoring::~LiveMonitoring() {
  if (session_) session_->End();
}

MonitorCallbacks LiveMonitoring::CallbacksOf(std::uint64_t epoch) {
  MonitorCallbacks callbacks;
  callbacks.begun = [this, epoch](const std::vector<Message>& warnings, bool judges) {
    loop_.Post("monitoring begun", [this, epoch, warnings, judges] {
      if (epoch != epoch_) return;
      warnings_.insert(warnings_.end(), warnings.begin(), warnings.end());
      judges_reference_ = judges;
    });
  };
  callbacks.warned = [this, epoch](const std::vector<Message>& warnings) {
    loop_.Post("monitoring warns", [this, epoch, warnings] {
      if (epoch == epoch_) warnings_.insert(warnings_.end(), warnings.begin(), warnings.end());
    });
  };
  callbacks.update = [this, epoch](const MonitorUpdate& update) {
    loop_.Post("monitoring", [this, epoch, update] {
      if (epoch == epoch_ && session_) OnUpdate(update);
    });
  };
  callbacks.failed = [this, epoch](const Message& why) {
    loop_.Post("monitoring failed", [this, epoch, why] {
      if (epoch == epoch_ && session_) hooks_.failed(why);
    });
  };
  callbacks.not_recorded = [this, epoch](const Message& why) {
    loop_.Post("monitoring not recorded", [this, epoch, why] {
      Log(LogLevel::kError, why.English());
      if (epoch != epoch_) return;
      is_recorded_ = false;
      warnings_.push_back(why);
    });
  };
  // Also of a session that has ended.
  callbacks.recorded = [this, scan = scan_id_](const std::string& file) {
    loop_.Post("monitoring recorded", [this, scan, file] {
      if (hooks_.recorded) hooks_.recorded(scan, file);
    });
  };
  return callbacks;
}

void LiveMonitoring::Begin(MonitorJob job, const std::shared_ptr<LiveFeed>& feed,
                           const CurrentScan& scan, const Message& why_no_record) {
  scan_id_ = scan.id;
  patient_id_ = scan.patient_id;
  limits_ = job.compare.limits;
  judges_reference_ = !job.reference_scene.empty();
  serials_.clear();
  if (job.second) serials_ = {job.serial, job.second->serial};
  warnings_.clear();
  accepted_.reset();
  ended_ = {};
  last_.reset();
  latencies_s_.clear();
  was_stale_ = false;
  began_s_ = SteadySeconds();
  is_recorded_ = job.record.has_value();
  if (!why_no_record.empty()) warnings_.push_back(why_no_record);
  session_ = std::make_shared<MonitorSession>(std::move(job), feed, CallbacksOf(++epoch_));
  std::shared_ptr<MonitorSession> before = session_;
  {
    const std::lock_guard lock(record_mutex_);
    std::swap(before, recorded_);
  }
  // The thread of the session before may still be ending; the loop does not wait for it.
  (void)store_thread_.Post([ended = std::move(before)]() mutable { ended.reset(); });
  tick_.ArmAfter(kLookAtAge);
}

Message LiveMonitoring::End(const Message& why) {
  ended_ = why;
  if (!session_) return {};
  tick_.Disarm();
  ++epoch_;
  if (!why.empty())
    session_->AddEvent({{"event", "stopped"},
                        {"time", MonitoringTime()},
                        {"why", why.English()},
                        {"why_message", MessageJson(why)}});
  session_->End();
  const auto shares = session_->Shares();
  session_.reset();  // kept for its record
  last_.reset();
  if (gate_) gate_(false);
  Tell();
  const double seconds = SteadySeconds() - began_s_;
  return shares ? say::audit::Monitored(seconds, 100 * (*shares)[0], 100 * (*shares)[1],
                                        100 * (*shares)[2])
                : say::audit::Monitored(seconds, 0, 0, 100);
}

std::shared_ptr<const MonitorSession> LiveMonitoring::Record() const {
  const std::lock_guard lock(record_mutex_);
  return recorded_;
}

MonitorStatus LiveMonitoring::status() const {
  MonitorStatus status;
  status.scan_id = scan_id_;
  status.ended = ended_;
  status.has_record = Record() != nullptr;
  status.active = IsActive();
  if (!IsActive()) return status;
  status.patient_id = patient_id_;
  status.state = Name(MonitorState::kMounting);
  status.judges_reference = judges_reference_;
  status.shift_tolerance_mm = limits_.shift_tolerance_m / kMillimetre;
  status.rotation_tolerance_deg = limits_.rotation_tolerance_rad / kDegree;
  status.elapsed_s = SteadySeconds() - began_s_;
  status.warnings = warnings_;
  status.is_recorded = is_recorded_;
  status.accepted = accepted_;
  if (!last_) return status;
  const MonitorLine& line = last_->line;
  const double age_s = SteadySeconds() - last_->arrived_s;
  status.age_s = age_s;
  status.state = Name(line.state);
  status.reason = Name(line.reason);
  status.frames = last_->frames;
  status.frames_dropped = last_->frames_dropped;
  status.has_breathing = last_->has_breathing;
  status.couch_moved = line.couch_moved;
  status.cpu_ms = last_->cpu_ms;
  if (last_->shares.size() == serials_.size()) {
    for (std::size_t i = 0; i < serials_.size(); ++i)
      status.sensors.push_back(
          {.serial = serials_[i],
           .share = std::string(
               Name(age_s > kLongestGap_s ? SensorShare::kNoImage : last_->shares[i]))});
  }
  status.one_sensor = OneSensor(status.sensors);
  if (!latencies_s_.empty()) {
    std::vector<double> latencies(latencies_s_.begin(), latencies_s_.end());
    status.latency_ms = 1e3 * TakeQuantile(latencies, 0.95);
  }
  status.is_old = age_s > kGrey_s;
  if (last_->breath_window)
    status.breath_hold = {
        .level_mm = last_->breath_window->level_m / kMillimetre,
        .window_mm = last_->breath_window->width_m / kMillimetre,
        .advice = std::string(Name(age_s > kLongestGap_s ? LiveAdvice::kUnknown : last_->breath))};
  if (age_s > kLongestGap_s) {
    status.reason = "no_image";
    if (line.state >= MonitorState::kMonitoring && line.state != MonitorState::kMovedSensor)
      status.state = Name(MonitorState::kBlind);
  } else {
    status.advice = Name(line.advice);
  }
  if (age_s > kGone_s) return status;
  if (line.since_zero) status.since_zero = NumbersOf(*line.since_zero);
  if (line.against_reference) status.against_reference = NumbersOf(*line.against_reference);
  if (line.breathing_m) status.breathing_mm = *line.breathing_m / kMillimetre;
  return status;
}

std::shared_ptr<const std::string> LiveMonitoring::Map() const {
  const bool is_new = last_ && SteadySeconds() - last_->map_s <= kGone_s;
  return is_new ? last_->map : nullptr;
}

IndicatorPattern LiveMonitoring::Pattern() const {
  const MonitorStatus now = status();
  if (now.state == Name(MonitorState::kMounting) || now.state == Name(MonitorState::kZeroing))
    return IndicatorPattern::kMonitorStarting;
  if (now.advice == Name(LiveAdvice::kIn)) return IndicatorPattern::kMonitorIn;
  return now.advice == Name(LiveAdvice::kOut) ? IndicatorPattern::kMonitorOut
                                              : IndicatorPattern::kMonitorUnknown;
}

Message LiveMonitoring::TeachBreath(double width_mm, BreathHold& taught) {
  if (!session_) return say::monitoring::NotRunning();
  const std::optional<BreathWindow> window = session_->TeachBreath(width_mm * kMillimetre);
  if (!window) return say::monitoring::BreathNotHeld();
  taught.level_mm = window->level_m / kMillimetre;
  taught.window_mm = window->width_m / kMillimetre;
  session_->AddEvent({{"event", "breath_taught"},
                      {"time", MonitoringTime()},
                      {"level_mm", taught.level_mm},
                      {"window_mm", taught.window_mm}});
  return {};
}

Message LiveMonitoring::ForgetBreath() {
  if (!session_) return say::monitoring::NotRunning();
  if (!session_->ForgetBreath()) return say::monitoring::NoBreathLevel();
  session_->AddEvent({{"event", "breath_forgotten"}, {"time", MonitoringTime()}});
  return {};
}

void LiveMonitoring::NoteAccepted(const AcceptedLive& accepted, const std::string& advice) {
  if (!session_) return;
  accepted_ = accepted;
  nlohmann::json event = AcceptedJson(accepted_);
  event["event"] = "accepted";
  event["advice"] = advice;
  session_->AddEvent(event);
  Tell();
}

void LiveMonitoring::OnUpdate(const MonitorUpdate& update) {
  last_ = update;
  was_stale_ = false;
  latencies_s_.push_back(update.done_s - update.arrived_s);
  if (latencies_s_.size() > kLatencies) latencies_s_.pop_front();
  // Once for each group of frames, and only as long as it is new.
  if (gate_) gate_(status().advice == Name(LiveAdvice::kIn));
  Tell();
}

void LiveMonitoring::OnTick() {
  tick_.ArmAfter(kLookAtAge);
  if (!last_) return;
  const double age_s = SteadySeconds() - last_->arrived_s;
  if (age_s <= kLongestGap_s) return;
  // Once when it becomes unknown, and then, until the number is gone, as it grows old.
  if (was_stale_ && age_s > kGone_s + 2 * std::chrono::duration<double>(kLookAtAge).count()) return;
  if (!was_stale_ && gate_) gate_(false);
  was_stale_ = true;
  Tell();
}

void LiveMonitoring::Tell() {
  if (hooks_.changed) hooks_.changed();
  nlohmann::json event = MonitorJson(status());
  event["event"] = "monitor";
  notices_.TellWatchers(event);
  notices_.TellPage(web::EventKind::kMonitor);
}

}  // namespace plumb
