// SPDX-License-Identifier: Apache-2.0
// The appliance's reports about itself: status, events, light.
#include <exception>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "daemon/appliance/appliance.hpp"
#include "daemon/appliance/control_lines.hpp"
#include "daemon/config/version.hpp"
#include "daemon/database/store_json.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/loop/loop_report.hpp"
#include "daemon/result/result_folder.hpp"
#include "words/upkeep.hpp"

namespace plumb {

namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::json;

double SecondsSince(Clock::time_point time) {
  return std::chrono::duration<double>(Clock::now() - time).count();
}

constexpr double kTooManyDropped = 0.2;

/// Advice for the sweep. Lost images override all other advice except lost tracking.
SweepAdvice AdviceOn(SweepAdvice seen, double dropped_fraction) {
  const bool is_slow = seen != SweepAdvice::kTrackingLost && dropped_fraction > kTooManyDropped;
  return is_slow ? SweepAdvice::kComputerTooSlow : seen;
}

Json SensorFields(const SensorSnapshot& sensor) {
  Json fields = {{"present", sensor.present},
                 {"serial", sensor.sensor.serial},
                 {"name", sensor.sensor.name},
                 {"fps", sensor.present ? sensor.statistics.frames_per_second : 0.0},
                 {"pairs", sensor.statistics.num_pairs},
                 {"unpaired", sensor.statistics.num_unpaired},
                 {"discarded", sensor.statistics.num_discarded},
                 {"lost", sensor.statistics.num_lost},
                 {"calibrated", sensor.present && !sensor.info.intrinsics_assumed},
                 {"others", sensor.others}};
  PutMessages(fields, "warning", sensor.info.warnings);
  return fields;
}

Json ResultFields(const CurrentScan& scan) {
  const EndedScan& ended = scan.outcome;
  const bool is_done = ended.kind == EndedScan::Kind::kDone;
  const bool has_no_scene = ended.kind == EndedScan::Kind::kNoScene;
  Json last = {{"scan", scan.id},
               {"is_reference", is_done && !ended.verdict},
               {"verdict", has_no_scene ? Json(Name(Verdict::kNoAnswer)) : Json(nullptr)},
               {"correction", nullptr},
               {"frames", ended.frames},
               {"frames_dropped", ended.frames_dropped},
               {"images_lost", scan.images.num_lost},
               {"images_unpaired", scan.images.num_unpaired},
               {"images_discarded", scan.images.num_discarded},
               {"after_last_frame_s", ended.after_last_frame_s}};
  PutMessages(last, "reason",
              has_no_scene               ? std::vector{ended.reason}
              : is_done && ended.verdict ? ended.reasons
                                         : std::vector<Message>());
  if (!is_done || !ended.verdict) return last;
  last["verdict"] = Name(*ended.verdict);
  // The numbers of a result without an answer are left out, because they must not be acted on.
  const bool is_shown = ended.correction && *ended.verdict != Verdict::kNoAnswer;
  const Json correction = is_shown ? Json(CorrectionJson(*ended.correction)) : Json(nullptr);
  last["correction"] = correction;
  for (const NumberAxis& axis : kNumberAxes)
    last[axis.key] = correction.is_object() ? correction[axis.key] : Json(nullptr);
  return last;
}

}  // namespace

IndicatorPattern Appliance::Pattern() const {
  if (PressMonitors()) return IndicatorPattern::kReadyToMonitor;
  switch (state_.phase) {
    case ApplianceState::kNoSensor:
      return IndicatorPattern::kNoSensor;
    case ApplianceState::kReady:
      if (!rolled_back_.empty()) return IndicatorPattern::kReadyRolledBack;
      if (page_.are_guesses_running) return IndicatorPattern::kReadyGuessed;
      return storage_.IsNearlyFull() ? IndicatorPattern::kReadyDiskNearlyFull
                                     : IndicatorPattern::kReady;
    case ApplianceState::kWorking:
      return IndicatorPattern::kWorking;
    case ApplianceState::kMonitoring:
      return monitoring_.Pattern();
    case ApplianceState::kFault:
      return IndicatorPattern::kFault;
    case ApplianceState::kScanning:
      break;
    case ApplianceState::kResult:
      if (scan_.outcome.kind == EndedScan::Kind::kNoScene ||
          scan_.outcome.verdict == Verdict::kNoAnswer)
        return IndicatorPattern::kNoAnswer;
      if (!scan_.outcome.verdict)
        return IndicatorPattern::kDone;  // without a comparison nothing is known about tolerance
      if (scan_.outcome.verdict == Verdict::kUnsure) return IndicatorPattern::kResultUnsure;
      return scan_.outcome.verdict == Verdict::kMove ? IndicatorPattern::kResultMove
                                                     : IndicatorPattern::kResultInTolerance;
  }
  switch (AdviceOn(scan_.update.guidance.advice, scan_.dropped_fraction)) {
    case SweepAdvice::kSlower:
    case SweepAdvice::kTrackingLost:
    case SweepAdvice::kComputerTooSlow:  // fewer frames: a slower sweep still overlaps enough
      return IndicatorPattern::kTooFast;
    case SweepAdvice::kFarther:
      return IndicatorPattern::kTooNear;
    case SweepAdvice::kCloser:
      return IndicatorPattern::kTooFar;
    default:
      return IndicatorPattern::kScanning;
  }
}

void Appliance::Show() {
  const IndicatorPattern pattern = Pattern();
  if (pattern == shown_) return;
  shown_ = pattern;
  if (parts_.indicator != nullptr) parts_.indicator->Show(pattern);
  notices_.TellWatchers(LightEvent(pattern));
}

void Appliance::SetPage(PageNotes page) {
  page_ = std::move(page);
  Show();
  notices_.TellPage(web::EventKind::kStatus);
}

void Appliance::SetRolledBack(const Message& why) {
  rolled_back_ = why;
  Show();
  notices_.TellPage(web::EventKind::kStatus);
}

void Appliance::PublishState() {
  Show();
  notices_.TellWatchers(StateEvent(state_.phase, FaultReason(), state_.cancelling));
  notices_.TellPage(web::EventKind::kStatus);
}

Message Appliance::FaultReason() const {
  if (state_.phase != ApplianceState::kFault) return {};
  switch (state_.fault) {
    case FaultKind::kStorage:
      return storage_.fault().empty() ? space_fault_ : storage_.fault();
    case FaultKind::kScan:
      return scan_fault_;
    case FaultKind::kSensor:
      return sensor_fault_;
    case FaultKind::kNone:
      break;
  }
  return {};
}

std::string Appliance::StatusLine() const {
  std::string line = fmt::format("{}", Name(state_.phase));
  if (state_.phase == ApplianceState::kScanning)
    line += fmt::format(", {} frames", scan_.update.frames);
  if (state_.phase == ApplianceState::kWorking)
    line += fmt::format(", {}", scan_.update.step.English());
  if (state_.phase == ApplianceState::kMonitoring)
    line += fmt::format(", {}", monitoring_.status().advice);
  if (state_.phase == ApplianceState::kFault) line += ": " + FaultReason().English();
  return line;
}

Json Appliance::StatusJson() {
  const SensorSnapshot sensor = sensors_.snapshot();
  const ScanUpdate& update = scan_.update;
  Json scan = ProgressFields(update, scan_.Coverage());
  scan["active"] = IsRunning();
  scan["id"] = scan_.id;
  scan["valid_depth"] = update.guidance.valid_depth;
  scan["without_new_surface_s"] = update.guidance.without_new_surface_s;
  scan["first_frame_ms"] = scan_.first_frame_ms;
  scan["cancel_ms"] = scan_.cancel_ms;
  const Json last = last_result_ ? ResultFields(*last_result_) : Json(nullptr);
  Json status = {{"state", Name(state_.phase)},
                 {"sensor", SensorFields(sensor)},
                 {"scan", scan},
                 {"last_result", last},
                 {"monitor", MonitorJson(monitoring_.status())},
                 {"light", Name(shown_)},
                 {"press", PressMonitors() ? "monitoring" : "sweep"},
                 {"page", {{"url", page_.url}, {"certificate", page_.certificate}}},
                 {"loop", LoopJson(loop_.meter())},
                 {"version", Version()}};
  PutMessage(status, "reason", FaultReason());
  PutMessage(status, "rolled_back", rolled_back_);
  PutMessages(status, "warning", StorageWarnings());
  std::vector<Message> warnings = page_.warnings;
  for (const MessageWay& way : messages_.status())
    if (!way.failure.empty()) warnings.push_back(way.failure);
  PutMessages(status["page"], "warning", warnings);
  PutMessage(status["sensor"], "profile_fault", profiles_.drift());
  return status;
}

Status Appliance::WebStatus() {
  const SensorSnapshot sensor = sensors_.snapshot();
  Status status;
  status.state = state_.phase;
  status.fault = FaultReason();
  if (state_.phase == ApplianceState::kFault) status.fault_kind = state_.fault;
  status.sensor = {.present = sensor.present,
                   .serial = sensor.sensor.serial,
                   .name = sensor.sensor.name,
                   .frames_per_second = sensor.present ? sensor.statistics.frames_per_second : 0.0,
                   .powered_s = references_.SensorOn_s().value_or(0.0),
                   .warm_up_s = 60 * references_.warm_up_min()};
  if (const auto space = storage_.SpaceForScans()) {
    status.storage = {.free_bytes = static_cast<std::int64_t>(space->available),
                      .total_bytes = static_cast<std::int64_t>(space->capacity)};
  }
  status.storage.writable = storage_.fault().empty() && !storage_.IsReadOnly();
  status.storage.warnings = StorageWarnings();
  status.storage.backup_made_at = upkeep_.backup_made_at();
  status.counts = counts_;
  status.light = Name(shown_);
  status.press_monitors = PressMonitors();
  status.patient_id = session_.check() ? std::string() : session_.patient_id();
  status.next_purpose = session_.purpose();
  if (IsRunning()) {
    status.scan =
        LiveScan{.id = scan_.id,
                 .patient_id = scan_.patient_id,
                 .purpose = scan_.purpose,
                 .elapsed_s = SecondsSince(scan_.started),
                 .coverage = scan_.Coverage(),
                 .without_new_surface_s = scan_.update.guidance.without_new_surface_s,
                 .guidance = AdviceOn(scan_.update.guidance.advice, scan_.dropped_fraction),
                 .keyframes = scan_.update.keyframes,
                 .frames = scan_.update.frames,
                 .frames_tracked = scan_.update.frames_tracked,
                 .frames_dropped = scan_.update.frames_dropped,
                 .step = scan_.update.step,
                 .step_fraction = scan_.update.fraction,
                 .forming = scan_.update.forming};
  }
  status.version = Version();
  status.warnings = page_.warnings;
  if (!profiles_.drift().empty()) status.warnings.push_back(profiles_.drift());
  status.rolled_back = rolled_back_;
  status.messages = messages_.status();
  status.peer_notes = peers_.notes();
  for (const MessageWay& way : status.messages)
    if (!way.failure.empty()) status.warnings.push_back(way.failure);
  if (!not_archived_.empty()) status.warnings.push_back(not_archived_);
  room_.Report(status);
  ReadStoredOrFail(status);
  return status;
}

std::optional<double> Appliance::AgeOf(const std::string& scan_id) const {
  return last_result_ && last_result_->id == scan_id
             ? std::optional(SecondsSince(last_result_->ended))
             : std::nullopt;
}

void Appliance::ReadStored(Status& status) {
  status.daily_check = references_.CheckToday();
  status.reference_block = references_.WhyNot();
  status.session = store_->treatments.Opened();
  if (status.session && status.session->id != session_.id()) status.session.reset();
  status.waiting = store_->references.Waiting();
  status.last_check = store_->checks.Last();
  status.couch = store_->couch.Get();
  status.wants_wristband = WantsWristband();
  if (session_.IsOpen())
    status.scans_today = store_->scans.CountSince(session_.patient_id(), StartOfDay());
  if (last_result_) status.last_result = store_->scans.Find(last_result_->id);
  if (status.last_result) {
    status.last_result->age_s = AgeOf(status.last_result->id);
    // Whoever began another sweep had a reason: its failure does not make this result valid again.
    status.last_result->is_superseded =
        scan_.id != last_result_->id && scan_.session_id == last_result_->session_id;
  }
}

void Appliance::ReadAll() {
  Status status;
  ReadStored(status);
}

/// A request for the status must not end the appliance. A failure is posted, because this call may
/// be part of reporting it.
void Appliance::ReadStoredOrFail(Status& status) {
  if (store_ == nullptr) return;
  try {
    ReadStored(status);
  } catch (const std::exception& error) {
    storage_.FailLater(error);
  }
}

Health Appliance::health() {
  if (storage_.has_configuration_fault()) return {.ok = false, .reason = storage_.fault()};
  if (!storage_.fault().empty())
    return {.ok = false, .reason = say::upkeep::StorageUnhealthy(storage_.fault())};
  if (storage_.IsReadOnly())
    return {.ok = false, .reason = say::upkeep::StorageUnhealthy(say::upkeep::ReadOnlyDisk())};
  if (const Message full = WhyNoSpace(); !full.empty())
    return {.ok = false, .reason = say::upkeep::StorageUnhealthy(full)};
  if (!WorkersAreAlive()) return {.ok = false, .reason = say::upkeep::NoProgress()};
  if (state_.phase == ApplianceState::kFault && state_.fault == FaultKind::kSensor)
    return {.ok = false, .reason = say::upkeep::SensorUnhealthy(sensor_fault_)};
  return {};
}

}  // namespace plumb
