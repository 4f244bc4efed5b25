// SPDX-License-Identifier: Apache-2.0
#include "tests/support/fake_appliance.hpp"
#include "words/check.hpp"
#include "words/scan.hpp"
#include "words/store.hpp"

#include <fmt/format.h>
#include <strings.h>

#include <algorithm>
#include <fstream>

namespace plumb::test {

using namespace web;  // NOLINT: a test's own names are none of these

FakeAppliance::FakeAppliance() {
  status.state = ApplianceState::kReady;
  status.sensor = {true, "1503150045", "Virtual Xtion", 30.0, 1800.0, 1200.0};
  status.storage = {std::int64_t{182} << 30, std::int64_t{238} << 30, true};
  status.light = "ready";
  status.version = "0.1.0-test";
  update.message = Message::Verbatim("updates need the appliance image");
}

Status FakeAppliance::GetStatus() {
  Status told = status;
  told.wants_wristband = WantsWristband();
  if (told.last_result && told.last_result->finished_at && !told.last_result->age_s)
    told.last_result->age_s =
        std::chrono::duration<double>(WallClock::now() - *told.last_result->finished_at).count();
  return told;
}

void FakeAppliance::Notify(EventKind kind) const {
  if (listener_) listener_(kind);
}

void FakeAppliance::Finish(const Done& done, Change change) {
  if (hold_completions) {
    held.push_back([done, change] { done(change); });
  } else {
    done(change);
  }
}

void FakeAppliance::Did(const Actor& actor, const std::string& action, const std::string& subject,
                        const Done& done, const std::string& id) {
  Log(actor, action, subject, {});
  Notify(EventKind::kData);
  Finish(done, DoneWith(id));
}

bool FakeAppliance::WantsWristband() const {
  return settings.scan_wristband && status.session && !is_check_ &&
         wristband_of_ != status.session->id;
}

void FakeAppliance::ConfirmWristband(const Actor& actor, const std::string& session_id,
                                     const std::string& code, Done done) {
  if (!status.session || status.session->id != session_id)
    return Finish(done, Refused(ChangeResult::kConflict, say::scan::SessionClosed()));
  if (PlainCode(code) != PlainCode(status.session->patient_code))
    return Finish(done, Refused(ChangeResult::kConflict,
                                say::scan::OtherWristband(status.session->patient_code)));
  wristband_of_ = session_id;
  Notify(EventKind::kStatus);
  Did(actor, "session.wristband", session_id, done);
}

void FakeAppliance::StartSweep(const Actor& actor, Done done) {
  if (status.state == ApplianceState::kReady || status.state == ApplianceState::kResult)
    return Press(actor, std::move(done));
  Finish(done,
         Refused(ChangeResult::kConflict, "a scan is running already: end or cancel it first"));
}

void FakeAppliance::EndSweep(const Actor& actor, Done done) {
  if (status.state == ApplianceState::kScanning) return Press(actor, std::move(done));
  Finish(done, Refused(ChangeResult::kConflict, "no scan is running"));
}

void FakeAppliance::StartMonitor(const Actor& actor, Done done) {
  if (status.state != ApplianceState::kReady && status.state != ApplianceState::kResult)
    return Finish(done, Refused(ChangeResult::kConflict, "a scan is running"));
  status.state = ApplianceState::kMonitoring;
  status.light = "monitor_starting";
  monitor = {.active = true, .scan_id = scans.empty() ? "" : scans.back().id, .state = "mounting"};
  monitor.has_record = true;
  monitor.shift_tolerance_mm = 3.0;
  monitor.rotation_tolerance_deg = 1.0;
  Notify(EventKind::kStatus);
  Notify(EventKind::kMonitor);
  Did(actor, "monitor.start", monitor.scan_id, done);
}

void FakeAppliance::AcceptLive(const Actor& actor, const std::string& reason, Done done) {
  if (settings.accept_live != kBySignature)
    return Finish(done, Refused(ChangeResult::kConflict, "a sweep has to confirm the position"));
  if (!monitor.against_reference || monitor.advice == "unknown")
    return Finish(done, Refused(ChangeResult::kConflict, "the position is not known now"));
  if (monitor.advice == "out" && reason.empty())
    return Finish(done, Refused(ChangeResult::kConflict, "give a reason"));
  monitor.accepted = {.by = actor.user,
                      .at = "2026-06-01T09:30:00Z",
                      .reason = reason,
                      .against_reference = *monitor.against_reference};
  Notify(EventKind::kMonitor);
  Did(actor, "monitor.accept", monitor.scan_id, done);
}

void FakeAppliance::TeachBreath(const Actor& actor, Done done) {
  if (!monitor.breathing_mm)
    return Finish(done, Refused(ChangeResult::kConflict, "the breath is not held"));
  monitor.breath_hold = {.level_mm = *monitor.breathing_mm, .window_mm = settings.breath_window_mm};
  Notify(EventKind::kMonitor);
  Did(actor, "monitor.breath_teach", monitor.scan_id, done);
}

void FakeAppliance::ForgetBreath(const Actor& actor, Done done) {
  monitor.breath_hold.reset();
  Notify(EventKind::kMonitor);
  Did(actor, "monitor.breath_forget", monitor.scan_id, done);
}

nlohmann::json FakeAppliance::MonitorRecords(const std::string& scan_id) {
  nlohmann::json records = nlohmann::json::array();
  if (!monitored_scan.empty() && scan_id == monitored_scan)
    records.push_back({{"number", 1}, {"head", monitor_report["head"]}});
  return records;
}

void FakeAppliance::StopMonitor(const Actor& actor, Done done) {
  if (!monitor.active)
    return Finish(done, Refused(ChangeResult::kConflict, "nothing is being monitored"));
  status.state = ApplianceState::kReady;
  status.light = "ready";
  monitor = {.scan_id = monitor.scan_id, .has_record = true};
  Notify(EventKind::kStatus);
  Notify(EventKind::kMonitor);
  Did(actor, "monitor.stop", monitor.scan_id, done);
}

void FakeAppliance::Fail(const std::string& reason) {
  if (status.scan && !is_check_) {
    scans.back().outcome = ScanOutcome::kFailed;
    scans.back().failure = Message::Verbatim(reason);
  }
  status.scan.reset();
  status.state = ApplianceState::kFault;
  status.fault = Message::Verbatim(reason);
  status.fault_kind = FaultKind::kScan;
  status.light = "fault";
  Notify(EventKind::kResult);
}

void FakeAppliance::Press(const Actor& actor, Done done) {
  if (status.fault_kind == FaultKind::kScan) {
    status.fault = {};
    status.fault_kind = FaultKind::kNone;
    status.state = ApplianceState::kReady;
    status.light = "ready";
    Notify(EventKind::kStatus);
    return Did(actor, "press", "", done);
  }
  if (status.state == ApplianceState::kScanning) {
    phase_begun_.reset();
    status.state = ApplianceState::kWorking;
    status.light = "working";
    status.scan->step = Message::Verbatim("surface");
    Notify(EventKind::kStatus);
    return Did(actor, "scan.end", status.scan->id, done);
  }
  if (status.state != ApplianceState::kReady && status.state != ApplianceState::kResult) {
    return Finish(
        done, Refused(ChangeResult::kConflict,
                      "in this state a press is ignored; it requires ready, scanning or result"));
  }
  if (WantsWristband())
    return Finish(done, Refused(ChangeResult::kConflict, say::scan::WristbandFirst()));
  if (!is_check_) wristband_of_.clear();
  Scan scan;
  scan.id = fmt::format("s{:04}", next_id_++);
  scan.patient_id = status.patient_id;
  scan.purpose = status.next_purpose;
  if (status.session && status.session->reference && scan.purpose == ScanPurpose::kFraction &&
      !status.patient_id.empty())
    scan.reference_id = status.session->reference->id;
  scan.started_at = WallClock::now();
  if (status.session) {
    scan.session_id = status.session->id;
    scan.fraction = status.session->fraction;
  }
  scan.sensor_on_s = status.sensor.powered_s;
  scan.daily_check = status.daily_check;
  if (!is_check_) scans.push_back(scan);
  status.scan = LiveScan{
      .id = scan.id,
      .patient_id = scan.patient_id,
      .purpose = scan.purpose,
      .coverage = scan.purpose == ScanPurpose::kFraction ? std::optional(0.0) : std::nullopt,
      .step = Message::Verbatim("tracking")};
  status.state = ApplianceState::kScanning;
  status.light = "scanning";
  phase_begun_.reset();
  Notify(EventKind::kStatus);
  Did(actor, "scan.start", scan.id, done);
}

void FakeAppliance::Cancel(const Actor& actor, Done done) {
  if (!status.scan)
    return Finish(
        done, Refused(ChangeResult::kConflict,
                      "in this state there is nothing to cancel; it requires scanning or working"));
  if (!is_check_) scans.back().outcome = ScanOutcome::kCancelled;
  if (!is_check_) scans.back().failure = Message::Verbatim("cancelled");
  if (status.last_result && !is_check_) status.last_result->is_superseded = true;
  CloseCheck();
  const std::string id = status.scan->id;
  status.scan.reset();
  status.state = ApplianceState::kReady;
  status.light = "ready";
  Notify(EventKind::kStatus);
  Did(actor, "cancel", id, done);
}

void FakeAppliance::Tick(std::chrono::steady_clock::time_point now) {
  if (!status.scan) return;
  if (!phase_begun_) phase_begun_ = now;
  const auto elapsed = std::chrono::duration_cast<std::chrono::milliseconds>(now - *phase_begun_);
  LiveScan& scan = *status.scan;
  if (status.state == ApplianceState::kScanning) {
    const double fraction =
        std::min(1.0, static_cast<double>(elapsed.count()) / static_cast<double>(sweep.count()));
    scan.elapsed_s = static_cast<double>(elapsed.count()) / 1000.0;
    swept = fraction;
    if (scan.coverage) scan.coverage = fraction;
    scan.without_new_surface_s = fraction > 0.8 ? 3.4 : 0.2;
    scan.guidance = fraction > 0.3 && fraction < 0.6 ? SweepAdvice::kSlower : SweepAdvice::kNone;
    if (guidance) scan.guidance = *guidance;
    if (scan.guidance == SweepAdvice::kEnough)
      scan.forming = FormingAnswer{
          .sweep_s = scan.elapsed_s,
          .numbers = MotionNumbers{{4.1, -2.6, 1.2, 0.4, -0.3, 0.9}, {1.4, 1.9, 1.6, .4, .5, .3}},
          .shift_tolerance_mm = 5,
          .rotation_tolerance_deg = 3,
          .is_enough = true};
    status.light = scan.guidance == SweepAdvice::kSlower ? "too_fast" : "scanning";
    scan.frames = static_cast<std::int64_t>(scan.elapsed_s * 30);
    scan.frames_tracked = scan.frames;
    scan.keyframes = scan.frames / 4;
    if (fraction >= 1.0) {
      phase_begun_ = now;
      status.state = ApplianceState::kWorking;
      status.light = "working";
      scan.step = Message::Verbatim("surface");
      scan.guidance = SweepAdvice::kNone;
    }
    Notify(EventKind::kProgress);
  } else {
    scan.step_fraction =
        std::min(1.0, static_cast<double>(elapsed.count()) / static_cast<double>(work.count()));
    Notify(EventKind::kProgress);
    if (elapsed >= work) EndScan();
  }
}

void FakeAppliance::CloseCheck() {
  if (!is_check_) return;
  is_check_ = false;
  status.next_purpose = status.session ? status.session->purpose : ScanPurpose::kFraction;
  status.patient_id = patient_before_check_;
}

void FakeAppliance::EndCheck() {
  CheckRecord check;
  check.id = fmt::format("{}", next_id_++);
  check.status = checks.baseline ? MarkerCheckStatus::kPassed : MarkerCheckStatus::kNoBaseline;
  check.num_markers = 12;
  check.items = {{"markers_seen", 12, 12, "", true, {}},
                 {"misfit", 0.84, 3, "mm", true, {}},
                 {"moved", 1.6, 5, "mm", true, say::check::Marker(4)},
                 {"scale", 0.08, 0.5, "%", true, {}},
                 {"side", -0.4, 3, "%", true, say::check::Marker(9)},
                 {"depth_scale", 0.62, 3, "%", true, {}}};
  if (!checks.baseline)
    check.reasons = {Message::Verbatim(
        "there is no baseline yet: if the markers are known to be in place, set this check as the "
        "baseline")};
  if (next_check) {
    const std::string id = check.id;
    check = *next_check;
    check.id = id;
    next_check.reset();
  }
  check.time = WallClock::now();
  check.user = checker_;
  check.sensor_serial = status.sensor.serial;
  checks.checks.insert(checks.checks.begin(), check);
  if (check.status == MarkerCheckStatus::kPassed) {
    checks.today = DailyCheck::kPassed;
    status.reference_block = {};
  } else if (check.status == MarkerCheckStatus::kFailed) {
    checks.today = DailyCheck::kFailed;
    status.reference_block = say::scan::CheckFailed();
  }
  checks.changes.clear();
  if (checks.baseline) {
    checks.changes.push_back(check.status == MarkerCheckStatus::kFailed
                                 ? say::check::BaselineMoved(7, 12)
                                 : say::check::BaselineSame());
  }
  status.last_check = check;
  status.daily_check = checks.today;
  status.scan.reset();
  status.state = ApplianceState::kResult;
  status.light = check.status == MarkerCheckStatus::kPassed ? "result_in_tolerance" : "no_answer";
  if (is_board_there) SeeBoard(check);
  CloseCheck();
  Notify(EventKind::kResult);
}

/// The third scan may be signed, as in the appliance.
void FakeAppliance::SeeBoard(const CheckRecord& check) {
  room.scans.insert(room.scans.begin(), {.check_id = check.id,
                                         .time = check.time,
                                         .user = check.user,
                                         .fault = {},
                                         .num_markers = 4,
                                         .rms_mm = 0.42,
                                         .scale_percent = 99.8,
                                         .shift_uncertainty_mm = 0.31,
                                         .turn_uncertainty_deg = 0.14});
  room.shift_mm = room.scans.size() == 1 ? 0 : 0.37;
  room.turn_deg = room.scans.size() == 1 ? 0 : 0.06;
  room.max_shift_mm = 1;
  room.max_turn_deg = 0.2;
  room.digest = std::string(63, 'a') + std::to_string(room.scans.size() % 10);
  room.why_not_sign = room.scans.size() < room.num_wanted
                          ? Message::Verbatim(fmt::format(
                                "{} of {} scans of the board have been made: scan again, without "
                                "touching it",
                                room.scans.size(), room.num_wanted))
                          : Message();
}

void FakeAppliance::SignCouch(const Actor& actor, const CouchProfile& couch, Done done) {
  if (couch.version != status.couch.version)
    return Finish(done, Refused(ChangeResult::kConflict, say::store::CouchChanged()));
  status.couch = couch;
  ++status.couch.version;
  status.couch.signed_by = actor.user;
  status.couch.signed_at = WallClock::now();
  Notify(EventKind::kStatus);
  const std::string version = std::to_string(status.couch.version);
  Did(actor, "couch.set", version, done, version);
}

void FakeAppliance::SignRoomCalibration(const Actor& actor, const std::string& digest, Done done) {
  if (room.scans.size() < room.num_wanted || !room.why_not_sign.empty())
    return Finish(done, Refused(ChangeResult::kConflict, room.why_not_sign));
  if (digest != room.digest) {
    return Finish(done, Refused(ChangeResult::kConflict,
                                "the board has been scanned again since this was read: read it "
                                "again"));
  }
  const int version = room.versions.empty() ? 1 : room.versions.front().version + 1;
  RoomCalibrationVersion made{.version = version,
                              .signed_at = WallClock::now(),
                              .signed_by = actor.user,
                              .digest = digest,
                              .shift_mm = *room.shift_mm,
                              .turn_deg = *room.turn_deg,
                              .check_ids = {}};
  for (const RoomBoardScan& scan : room.scans) made.check_ids.push_back(scan.check_id);
  room.versions.insert(room.versions.begin(), made);
  room.scans.clear();
  room.shift_mm.reset();
  room.turn_deg.reset();
  room.digest.clear();
  room.due = {};
  room.why_not_sign = Message::Verbatim("the board has not been scanned yet");
  status.room.is_known = true;
  Did(actor, "room.calibrate", std::to_string(version), done, std::to_string(version));
}

std::optional<std::string> FakeAppliance::RoomBoardPdf(Message& why_not) {
  if (!status.sensor.present) {
    why_not = Message::Verbatim("no sensor is attached");
    return std::nullopt;
  }
  return "%PDF-1.5 of a test";
}

void FakeAppliance::OpenCheck(const Actor& actor, Done done) {
  if (status.scan) return Finish(done, Refused(ChangeResult::kConflict, "a scan is running"));
  if (!is_check_) patient_before_check_ = status.patient_id;
  is_check_ = true;
  checker_ = actor.user;
  status.patient_id.clear();
  status.next_purpose = ScanPurpose::kDailyCheck;
  Notify(EventKind::kStatus);
  Did(actor, "check.open", "", done);
}

void FakeAppliance::LeaveCheck(const Actor& actor, Done done) {
  if (status.scan || !is_check_)
    return Finish(done, Refused(ChangeResult::kConflict, "no daily check is open"));
  CloseCheck();
  Notify(EventKind::kStatus);
  Did(actor, "check.leave", "", done);
}

void FakeAppliance::SetCheckBaseline(const Actor& actor, const std::string& check_id,
                                     const std::string&, Done done) {
  const auto found = std::find_if(checks.checks.begin(), checks.checks.end(),
                                  [&](const CheckRecord& check) { return check.id == check_id; });
  if (found == checks.checks.end())
    return Finish(done, Refused(ChangeResult::kNotFound, "there is no such check"));
  if (found->user == actor.user)
    return Finish(done, Refused(ChangeResult::kRefused, "another person sets it as the baseline"));
  checks.baseline = CheckBaseline{check_id, WallClock::now(), actor.user, found->num_markers};
  checks.changes = {say::check::BaselineSame()};
  Did(actor, "check.baseline", check_id, done);
}

SensorRepeats FakeAppliance::GetSensorRepeats() {
  SensorRepeats told = repeats;
  told.serial = profiles.serial;
  for (const Scan& scan : scans)
    if (scan.patient_id.empty() && scan.outcome == ScanOutcome::kDone && scan.id > judged_to_)
      told.sweeps.push_back({scan.id, scan.started_at});
  if (told.sweeps.size() > kRepeatsWanted)
    told.sweeps.erase(told.sweeps.begin(), told.sweeps.end() - kRepeatsWanted);
  return told;
}

void FakeAppliance::JudgeSensorRepeats(const Actor& actor, const std::string& serial, Done done) {
  const SensorRepeats now = GetSensorRepeats();
  if (serial != profiles.serial)
    return Finish(done, Refused(ChangeResult::kConflict, say::scan::OtherSensor(serial)));
  if (now.sweeps.size() < kRepeatsWanted)
    return Finish(done, Refused(ChangeResult::kConflict,
                                say::store::RepeatsTooFew(static_cast<int>(now.sweeps.size()),
                                                          kRepeatsWanted)));
  judged_to_ = now.sweeps.back().scan_id;
  repeats.judged =
      R"({"format":1,"fit":true,"reasons":[],"reason_messages":[],"intervals":{"held":18,"of":18},)"
      R"("scatter":{"vertical_mm":0.21,"longitudinal_mm":0.34,"lateral_mm":0.29,"pitch_deg":0.041,)"
      R"("roll_deg":0.052,"yaw_deg":0.033},"user":")" +
      actor.user + R"(","made_s":1790000000,"profile_version":3,"scans":[]})";
  repeats.is_due = false;
  Did(actor, "sensor.judged", serial, done);
}

std::optional<std::string> FakeAppliance::SensorProfileFile(int version) {
  for (const SensorProfileVersion& one : profiles.versions)
    if (one.version == version && one.num_sweeps > 0) return "{}";
  return std::nullopt;
}

void FakeAppliance::ResetSensorProfile(const Actor& actor, const std::string& serial, Done done) {
  if (serial != profiles.serial)
    return Finish(done, Refused(ChangeResult::kConflict, "the sensor is not connected"));
  repeats.is_due = true;
  SensorProfileVersion reset;
  reset.version = profiles.versions.empty() ? 1 : profiles.versions.front().version + 1;
  reset.made_at = WallClock::now();
  reset.cause = ProfileCause::kReset;
  profiles.versions.insert(profiles.versions.begin(), reset);
  Did(actor, "profile.reset", serial, done);
}

void FakeAppliance::RollBackSensorProfile(const Actor& actor, const std::string& serial,
                                          int version, Done done) {
  if (serial != profiles.serial)
    return Finish(done, Refused(ChangeResult::kConflict, "the sensor is not connected"));
  for (SensorProfileVersion one : profiles.versions) {
    if (one.version != version || one.num_sweeps == 0) continue;
    one.version = profiles.versions.front().version + 1;
    one.cause = ProfileCause::kRolledBack;
    profiles.versions.insert(profiles.versions.begin(), one);
    return Did(actor, "profile.roll_back", serial, done);
  }
  Finish(done, Refused(ChangeResult::kNotFound, "there is no such version"));
}

void FakeAppliance::EndScan() {
  if (is_check_) return EndCheck();
  Scan& scan = scans.back();
  scan.outcome = ScanOutcome::kDone;
  scan.finished_at = WallClock::now();
  if (!recorded.empty()) {
    const Recorded data =
        next_recorded ? *next_recorded : recorded[std::min(num_finished_, recorded.size() - 1)]();
    if (!next_recorded) ++num_finished_;
    next_recorded.reset();
    scan.folder = data.folder;
    if (!scan.reference_id.empty()) scan.result = data.result;
  }
  status.scan.reset();
  status.state = ApplianceState::kResult;
  status.light = !scan.result                                    ? "done"
                 : scan.result->verdict == Verdict::kMove        ? "result_move"
                 : scan.result->verdict == Verdict::kInTolerance ? "result_in_tolerance"
                 : scan.result->verdict == Verdict::kUnsure      ? "result_unsure"
                                                                 : "no_answer";
  status.last_result = scan;
  if (status.session) {
    ++status.session->num_scans;
    status.session->has_unaccepted = scan.result.has_value();
  }
  ++status.scans_today;
  if (Patient* patient = PatientOf(scan.patient_id)) {
    ++patient->num_scans;
    if (scan.purpose == ScanPurpose::kReference) MakeReference(scan, "technician", "");
  }
  Notify(EventKind::kResult);
}

void FakeAppliance::Unplug() {
  status.sensor.present = false;
  status.state = ApplianceState::kNoSensor;
  status.light = "no_sensor";
  if (status.scan) {
    if (!is_check_) {
      scans.back().outcome = ScanOutcome::kFailed;
      scans.back().failure = Message::Verbatim("the sensor was unplugged; the scan is discarded");
    }
    CloseCheck();
    status.scan.reset();
    Notify(EventKind::kResult);
  }
  Notify(EventKind::kStatus);
}

void FakeAppliance::Plug() {
  status.sensor.present = true;
  status.state = ApplianceState::kReady;
  status.light = "ready";
  Notify(EventKind::kStatus);
}

void FakeAppliance::SetTemplate(const Actor& actor, const PlanTemplate& wanted, Done done) {
  std::erase_if(templates, [&](const PlanTemplate& old) {
    return strcasecmp(old.site.c_str(), wanted.site.c_str()) == 0;
  });
  templates.push_back(wanted);
  templates.back().changed_by = actor.user;
  Did(actor, "template.set", "", done);
}

void FakeAppliance::RemoveTemplate(const Actor& actor, const std::string& site, Done done) {
  if (std::erase_if(templates, [&](const PlanTemplate& old) {
        return strcasecmp(old.site.c_str(), site.c_str()) == 0;
      }) == 0)
    return Finish(done, Refused(ChangeResult::kNotFound, "there is no template of this site"));
  Did(actor, "template.remove", "", done);
}

}  // namespace plumb::test
