// SPDX-License-Identifier: Apache-2.0
// A scan of the appliance from its beginning to its result.
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/appliance/appliance.hpp"
#include "daemon/appliance/control_lines.hpp"
#include "daemon/appliance/plan_options.hpp"
#include "daemon/database/stored_values.hpp"
#include "daemon/loop/log.hpp"
#include "words/scan.hpp"

namespace plumb {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kDroppedSmoothing_s = 1.0;
const Actor kAuto{.user = "auto", .address = ""};

double Milliseconds(Clock::duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

Message CheckAnswer(MarkerCheckStatus status) {
  switch (status) {
    case MarkerCheckStatus::kPassed:
      return say::scan::AnswerCheckPassed();
    case MarkerCheckStatus::kFailed:
      return say::scan::AnswerCheckFailed();
    case MarkerCheckStatus::kNoBaseline:
      return say::scan::AnswerCheckNoBaseline();
  }
  return {};
}

Message VerdictAnswer(Verdict verdict) {
  switch (verdict) {
    case Verdict::kInTolerance:
      return say::scan::AnswerInTolerance();
    case Verdict::kUnsure:
      return say::scan::AnswerUnsure();
    case Verdict::kMove:
      return say::scan::AnswerMove();
    case Verdict::kNoAnswer:
      return say::scan::AnswerNoAnswer();
  }
  return {};
}

/// The verdict, or why there is none.
Message AnswerOf(const EndedScan& outcome) {
  if (outcome.check) return CheckAnswer(outcome.check->check.status);
  if (outcome.verdict) return VerdictAnswer(*outcome.verdict);
  return outcome.kind == EndedScan::Kind::kNoScene ? outcome.reason : say::scan::NoComparison();
}

}  // namespace

void Appliance::StartScan() {
  try {
    BeginScan();
  } catch (const std::exception& error) {
    scan_fault_ = say::scan::CouldNotBegin(MessageOf(error));
    Log(LogLevel::kError, scan_fault_.English());
    loop_.Post("scan failed", [this] { (void)Handle(ScanEvent::kScanFailed); });
  }
}

void Appliance::BeginScan() {
  running_.reset();  // the previous one has ended
  scan_ = {};
  const bool is_check = session_.check().has_value();
  scan_.patient_id = is_check ? std::string() : session_.patient_id();
  scan_.session_id = is_check ? std::string() : session_.id();
  scan_.purpose = session_.purpose();
  scan_.started = Clock::now();
  const Settings settings = store_->settings.Get();
  ScanJob job = MakeJob(settings);
  if (job.is_reference) {
    if (const Message why = references_.WhyNot(); !why.empty()) throw DataError(why);
  }
  const NewScan record{.patient_id = scan_.patient_id,
                       .reference_id = scan_.reference_id,
                       .purpose = scan_.purpose,
                       .sensor_serial = sensors_.snapshot().sensor.serial,
                       .reason = session_.reason(),
                       .session_id = scan_.session_id,
                       .sensor_on_s = references_.SensorOn_s(),
                       .daily_check = references_.CheckToday()};
  scan_.sensor_before = sensors_.snapshot().statistics;
  session_.ArmTimer();
  running_ = std::make_unique<ScanSession>(
      std::move(job), is_check ? MakeCheckCallbacks(record) : MakeCallbacks(record));
  sensors_.BeginScan(running_->feed());
  limit_timer_.ArmAfterSeconds(settings.scan_limit_s);
}

std::string Appliance::ScanKind() const {
  const bool is_unassigned = scan_.patient_id.empty() && scan_.purpose != ScanPurpose::kDailyCheck;
  return std::string(is_unassigned ? "unassigned" : Name(scan_.purpose));
}

std::function<Message(const std::stop_token&)> Appliance::SceneCheck(
    const std::string& scan) const {
  return [&store = store_, scan](const std::stop_token& stop) {
    return store->integrity.Check(scan, /*scene_only=*/true, stop);
  };
}

ScanJob Appliance::MakeJob(const Settings& settings) {
  ScanJob job;
  const SensorSnapshot sensor = sensors_.snapshot();
  job.info = sensor.info;
  job.reconstructor = parts_.config.reconstruct;
  job.reconstructor.sensor_serial = OwnSerial(sensor.sensor);
  job.reconstructor.keep_color = false;  // only the shape of a patient is stored
  job.keep_recording = settings.keep_recordings;
  job.unit_profile = profiles_.ForScan();
  job.stop_after_s = settings.auto_stop_s;
  if (session_.check()) {
    job.keep_recording = false;
    job.check = CheckJob{store_->checks.BaselineMarkers(), parts_.config.check};
    return job;
  }
  if (scan_.patient_id.empty()) return job;  // no session is open, so there is no comparison
  const std::optional<Reference> reference = store_->references.OfSession(scan_.session_id);
  if (reference) scan_.reference_area_m2 = store_->scans.SweptArea(reference->scan_id);
  if (!reference && scan_.purpose == ScanPurpose::kFraction)
    scan_.purpose = ScanPurpose::kReference;
  job.is_reference = scan_.purpose == ScanPurpose::kReference;
  if (reference && scan_.purpose == ScanPurpose::kFraction) {
    scan_.reference_id = reference->id;
    job.reference_scene = store_->folders.Scan(reference->scan_id) / "scene";
    job.check_reference = SceneCheck(reference->scan_id);
    job.compare = CompareOptionsFor(reference->plan, parts_.config.compare);
    job.compare.now_s = SteadySeconds;
    job.room = room_.OfJob();
    job.reference_room = [state = storage_.state(), patient = scan_.patient_id,
                          scan = reference->scan_id,
                          most_days = parts_.config.appliance.room_max_age_days] {
      return UnlessTooOld(RoomOfImport(state, patient, scan), WallClock::now(), most_days);
    };
  }
  return job;
}

/// These run on the scan's thread: they use the store, which is thread-safe, and copies; everything
/// else is posted. Of a check only its numbers are kept.
ScanCallbacks Appliance::MakeCallbacks(const NewScan& record) {
  ScanCallbacks callbacks;
  auto id = std::make_shared<std::string>();
  callbacks.begin = [this, record, id] {
    *id = store_->scans.Begin(record);
    loop_.Post("scan begun", [this, id] { scan_.id = *id; });
    return store_->folders.Staging(*id);
  };
  const bool is_demo = !parts_.demo_patient.empty() && record.purpose == ScanPurpose::kReference;
  const ReferencePlan plan = DefaultPlan(store_->settings.Get());
  const bool is_reference = record.purpose == ScanPurpose::kReference;
  callbacks.save = [this, id, plan, is_demo, is_reference, reason = record.reason,
                    actor = session_.opened_by(),
                    patient = record.patient_id](const EndedScan& outcome) {
    if (id->empty()) return;  // it never began
    using Kind = EndedScan::Kind;
    // A scan that is discarded or fails while its result is being written has no result.
    const bool is_done = outcome.kind == Kind::kDone;
    FinishedScan finished{.failure = outcome.reason,
                          .result_json = is_done ? outcome.result_json : std::string(),
                          .swept_area_m2 = outcome.swept_area_m2};
    if (is_done) finished.outcome = ScanOutcome::kDone;
    if (outcome.kind == Kind::kCancelled) finished.outcome = ScanOutcome::kCancelled;
    store_->scans.Finish(*id, finished);
    const auto demo = store_->patients.FindByCode(parts_.demo_patient);
    if (!is_reference || !is_done) return;
    if (!is_demo || !demo || demo->id != patient || !demo->approved_reference_id.empty()) {
      (void)store_->references.Add(actor, *id, reason, plan);  // a draft that a physicist will plan
      return;
    }
    store_->references.Approve(kAuto,
                               store_->references.Add(kAuto, *id, "first scan of the demo", plan),
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
  callbacks.ended = [this](const EndedScan& outcome) {
    loop_.Post("scan ended", [this, outcome] { OnEnded(outcome); });
  };
}

ScanCallbacks Appliance::MakeCheckCallbacks(const NewScan& record) {
  ScanCallbacks callbacks;
  callbacks.begin = [] { return std::filesystem::path(); };
  callbacks.save = [this, actor = session_.check().value(),
                    serial = record.sensor_serial](const EndedScan& outcome) {
    if (outcome.check) (void)store_->checks.Add(actor, serial, *outcome.check);
  };
  AddListeners(callbacks);
  return callbacks;
}

void Appliance::OnUpdate(const ScanUpdate& update) {
  if (scan_.has_ended) return;
  if (update.frames > 0 && scan_.update.frames == 0)
    scan_.first_frame_ms = Milliseconds(Clock::now() - scan_.started);
  NoteDropped(update);
  scan_.update = update;
  Show();
  notices_.TellWatchers(ProgressEvent(scan_.id, scan_.update, scan_.Coverage()));
  notices_.TellPage(web::EventKind::kProgress);
}

void Appliance::NoteDropped(const ScanUpdate& update) {
  const double lost = static_cast<double>(update.frames_dropped - scan_.update.frames_dropped);
  const double seen = static_cast<double>(update.frames - scan_.update.frames);
  if (lost + seen <= 0) return;
  const double weight = 1.0 - std::exp(-(lost + seen) / (30.0 * kDroppedSmoothing_s));
  scan_.dropped_fraction += weight * (lost / (lost + seen) - scan_.dropped_fraction);
}

void Appliance::Count(const EndedScan& outcome) {
  using Kind = EndedScan::Kind;
  counts_.frames += outcome.frames;
  counts_.frames_dropped += outcome.frames_dropped;
  if (outcome.kind == Kind::kCancelled || outcome.kind == Kind::kFailed) {
    ++(outcome.kind == Kind::kFailed ? counts_.failed : counts_.cancelled);
    return;
  }
  counts_.answer_s = outcome.after_last_frame_s;
  if (outcome.verdict && scan_.purpose != ScanPurpose::kDailyCheck)
    ++counts_.verdicts[static_cast<std::size_t>(*outcome.verdict)];
  else
    ++counts_.without_comparison;
}

void Appliance::OnEnded(const EndedScan& outcome) {
  using Kind = EndedScan::Kind;
  Count(outcome);
  limit_timer_.Disarm();
  sensors_.EndScan();
  // Its thread has nothing left to do, but may still wait for a processor to end.
  (void)store_thread_.Post(
      [ended = std::shared_ptr<ScanSession>(std::move(running_))]() mutable { ended.reset(); });
  session_.ArmTimer();
  scan_.has_ended = true;
  scan_.ended = Clock::now();
  scan_.outcome = outcome;
  if (outcome.kind == Kind::kCancelled) {
    scan_.cancel_ms = Milliseconds(Clock::now() - scan_.cancelled_at);
    Log(LogLevel::kNotice, fmt::format("the scan was discarded within {:.0f} ms", scan_.cancel_ms),
        {{"SCAN", scan_.id}});
    (void)Handle(ScanEvent::kScanCancelled);
  } else if (outcome.kind == Kind::kFailed) {
    scan_fault_ = say::scan::Failed(outcome.reason);
    Log(LogLevel::kError, scan_fault_.English(), {{"SCAN", scan_.id}});
    (void)Handle(ScanEvent::kScanFailed);
    upkeep_.CheckDiskAtOnce();
  } else {
    if (state_.cancelling)
      Log(LogLevel::kNotice, "the scan was stored before it could be discarded: its result stands",
          {{"SCAN", scan_.id}});
    const bool is_check = scan_.purpose == ScanPurpose::kDailyCheck;
    if (!is_check) last_result_ = scan_;
    const Message answer = AnswerOf(outcome);
    Log(LogLevel::kInfo,
        fmt::format("the scan is done {:.2f} s after its last frame, {} frames, {} dropped: {}",
                    outcome.after_last_frame_s, outcome.frames, outcome.frames_dropped,
                    answer.English()),
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
    notices_.TellWatchers(ResultEvent(scan_.id, answer));
  }
  if (outcome.kind == Kind::kDone) profiles_.SetDrift(outcome.drift);
  if (scan_.purpose == ScanPurpose::kDailyCheck) room_.Refresh();
  session_.SetCheck({});
  notices_.TellPage(web::EventKind::kResult);
  notices_.TellPage(web::EventKind::kData);
  upkeep_.ScanEnded();
  if (stopped_) std::exchange(stopped_, nullptr)();
}

}  // namespace plumb
