#include "tests/support/fake_scan_service.hpp"

#include <fmt/format.h>

#include <strings.h>

#include <algorithm>
#include <fstream>

namespace plumb::test {

using namespace web;  // NOLINT: a test's own names are none of these

namespace {

Change Refusal(ChangeResult result, std::string message) {
  return {result, std::move(message), "", ""};
}

template <typename T>
std::optional<T> FindById(const std::vector<T>& items, const std::string& id) {
  const auto found =
      std::find_if(items.begin(), items.end(), [&](const T& item) { return item.id == id; });
  return found == items.end() ? std::nullopt : std::optional(*found);
}

}  // namespace

FakeScanService::FakeScanService() {
  status.state = ApplianceState::kReady;
  status.sensor = {true, "1503150045", "Virtual Xtion", 30.0, 1800.0};
  status.storage = {std::int64_t{182} << 30, std::int64_t{238} << 30, true};
  status.light = "ready";
  status.version = "0.1.0-test";
  update.message = "updates need the appliance image";
}

void FakeScanService::Tell(EventKind kind) const {
  if (listener_) listener_(kind);
}

void FakeScanService::Finish(const Done& done, Change change) {
  if (hold_completions) {
    held.push_back([done, change] { done(change); });
  } else {
    done(change);
  }
}

void FakeScanService::Did(const Actor& actor, const std::string& action, const std::string& subject,
                          const Done& done, const std::string& id) {
  Log(actor, action, subject, "");
  Tell(EventKind::kData);
  Finish(done, {ChangeResult::kDone, "", id, ""});
}

Patient* FakeScanService::PatientOf(const std::string& id) {
  const auto found = std::find_if(patients.begin(), patients.end(),
                                  [&](const Patient& patient) { return patient.id == id; });
  return found == patients.end() ? nullptr : &*found;
}

void FakeScanService::StartSweep(const Actor& actor, Done done) {
  if (status.state == ApplianceState::kReady || status.state == ApplianceState::kResult)
    return Press(actor, std::move(done));
  Finish(done,
         Refusal(ChangeResult::kConflict, "a scan is running already: end or cancel it first"));
}

void FakeScanService::EndSweep(const Actor& actor, Done done) {
  if (status.state == ApplianceState::kScanning) return Press(actor, std::move(done));
  Finish(done, Refusal(ChangeResult::kConflict, "no scan is running"));
}

void FakeScanService::Fail(const std::string& reason) {
  if (status.scan && !is_check_) {
    scans.back().outcome = ScanOutcome::kFailed;
    scans.back().failure = reason;
  }
  status.scan.reset();
  status.state = ApplianceState::kFault;
  status.fault = reason;
  status.fault_kind = FaultKind::kScan;
  status.light = "fault";
  Tell(EventKind::kResult);
}

void FakeScanService::Press(const Actor& actor, Done done) {
  if (status.fault_kind == FaultKind::kScan) {
    status.fault.clear();
    status.fault_kind = FaultKind::kNone;
    status.state = ApplianceState::kReady;
    status.light = "ready";
    Tell(EventKind::kStatus);
    return Did(actor, "press", "", done);
  }
  if (status.state == ApplianceState::kScanning) {
    phase_begun_.reset();
    status.state = ApplianceState::kWorking;
    status.light = "working";
    status.scan->step = "surfaces";
    Tell(EventKind::kStatus);
    return Did(actor, "press", status.scan->id, done);
  }
  if (status.state != ApplianceState::kReady && status.state != ApplianceState::kResult) {
    return Finish(
        done, Refusal(ChangeResult::kConflict,
                      "in this state a press is ignored; it requires ready, scanning or result"));
  }
  Scan scan;
  scan.id = fmt::format("s{:04}", next_id_++);
  scan.patient_id = status.patient_id;
  scan.purpose = status.next_purpose;
  if (const Patient* patient = PatientOf(status.patient_id);
      patient != nullptr && scan.purpose == ScanPurpose::kFraction) {
    scan.reference_id = patient->approved_reference_id;
  }
  scan.started_at = WallClock::now();
  if (status.session) {
    scan.session_id = status.session->id;
    scan.fraction = status.session->fraction;
  }
  scan.sensor_on_s = status.sensor.powered_s;
  scan.check_overdue = status.check_overdue;
  if (!is_check_) scans.push_back(scan);
  status.scan = LiveScan{.id = scan.id,
                         .patient_id = scan.patient_id,
                         .purpose = scan.purpose,
                         .coverage = 0.0,
                         .step = "tracking"};
  status.state = ApplianceState::kScanning;
  status.light = "scanning";
  phase_begun_.reset();
  Tell(EventKind::kStatus);
  Did(actor, "press", scan.id, done);
}

void FakeScanService::Cancel(const Actor& actor, Done done) {
  if (!status.scan)
    return Finish(
        done, Refusal(ChangeResult::kConflict,
                      "in this state there is nothing to cancel; it requires scanning or working"));
  if (!is_check_) scans.back().outcome = ScanOutcome::kCancelled;
  if (!is_check_) scans.back().failure = "cancelled";
  CloseCheck();
  const std::string id = status.scan->id;
  status.scan.reset();
  status.state = ApplianceState::kReady;
  status.light = "ready";
  Tell(EventKind::kStatus);
  Did(actor, "cancel", id, done);
}

void FakeScanService::Tick(std::chrono::steady_clock::time_point now) {
  if (!status.scan) return;
  if (!phase_begun_) phase_begun_ = now;
  const auto elapsed = std::chrono::duration_cast<std::chrono::milliseconds>(now - *phase_begun_);
  LiveScan& scan = *status.scan;
  if (status.state == ApplianceState::kScanning) {
    const double fraction =
        std::min(1.0, static_cast<double>(elapsed.count()) / static_cast<double>(sweep.count()));
    scan.elapsed_s = static_cast<double>(elapsed.count()) / 1000.0;
    scan.coverage = fraction;
    scan.guidance = fraction > 0.3 && fraction < 0.6 ? Guidance::kSlower : Guidance::kNone;
    if (guidance) scan.guidance = *guidance;
    status.light = scan.guidance == Guidance::kSlower ? "too_fast" : "scanning";
    scan.frames = static_cast<std::int64_t>(scan.elapsed_s * 30);
    scan.frames_tracked = scan.frames;
    scan.keyframes = scan.frames / 4;
    if (fraction >= 1.0) {
      phase_begun_ = now;
      status.state = ApplianceState::kWorking;
      status.light = "working";
      scan.step = "surfaces";
      scan.guidance = Guidance::kNone;
    }
    Tell(EventKind::kProgress);
  } else {
    scan.step_fraction =
        std::min(1.0, static_cast<double>(elapsed.count()) / static_cast<double>(work.count()));
    Tell(EventKind::kProgress);
    if (elapsed >= work) EndScan();
  }
}

void FakeScanService::CloseCheck() {
  if (!is_check_) return;
  is_check_ = false;
  status.next_purpose = ScanPurpose::kFraction;
  status.patient_id = patient_before_check_;
}

void FakeScanService::EndCheck() {
  CheckRecord check;
  check.id = fmt::format("{}", next_id_++);
  check.status = checks.baseline ? "passed" : "no_baseline";
  check.num_markers = 12;
  check.items = {
      {"markers_seen", 12, 12, "", true, ""},    {"misfit", 0.84, 3, "mm", true, ""},
      {"moved", 1.6, 5, "mm", true, "marker 4"}, {"scale", 0.08, 0.5, "%", true, ""},
      {"side", -0.4, 3, "%", true, "marker 9"},  {"depth_scale", 0.62, 3, "%", true, ""}};
  if (!checks.baseline)
    check.reasons = {
        "there is no baseline yet: somebody who knows that the markers lie right takes this check "
        "as the baseline"};
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
  if (check.status == "passed") {
    checks.overdue = false;
    status.reference_block.clear();
  }
  status.last_check = check;
  status.check_overdue = checks.overdue;
  status.scan.reset();
  status.state = ApplianceState::kResult;
  status.light = check.status == "passed" ? "result_in_tolerance" : "no_answer";
  CloseCheck();
  Tell(EventKind::kResult);
}

void FakeScanService::OpenCheck(const Actor& actor, Done done) {
  if (status.scan) return Finish(done, Refusal(ChangeResult::kConflict, "a scan is running"));
  if (!is_check_) patient_before_check_ = status.patient_id;
  is_check_ = true;
  checker_ = actor.user;
  status.patient_id.clear();
  status.next_purpose = ScanPurpose::kDailyCheck;
  Tell(EventKind::kStatus);
  Did(actor, "check.open", "", done);
}

void FakeScanService::SetCheckBaseline(const Actor& actor, const std::string& check_id, Done done) {
  const auto found = std::find_if(checks.checks.begin(), checks.checks.end(),
                                  [&](const CheckRecord& check) { return check.id == check_id; });
  if (found == checks.checks.end())
    return Finish(done, Refusal(ChangeResult::kNotFound, "there is no such check"));
  if (found->user == actor.user)
    return Finish(done, Refusal(ChangeResult::kRefused, "another person sets it as the baseline"));
  checks.baseline = CheckBaseline{check_id, WallClock::now(), actor.user, found->num_markers};
  Did(actor, "check.baseline", check_id, done);
}

std::optional<std::string> FakeScanService::SensorProfileFile(int version) {
  for (const SensorProfileVersion& one : profiles.versions)
    if (one.version == version && one.num_sweeps > 0) return "{}";
  return std::nullopt;
}

void FakeScanService::ResetSensorProfile(const Actor& actor, const std::string& serial, Done done) {
  if (serial != profiles.serial)
    return Finish(done, Refusal(ChangeResult::kConflict, "the sensor is not connected"));
  SensorProfileVersion reset;
  reset.version = profiles.versions.empty() ? 1 : profiles.versions.front().version + 1;
  reset.made_at = WallClock::now();
  reset.cause = "reset";
  profiles.versions.insert(profiles.versions.begin(), reset);
  Did(actor, "profile.reset", serial, done);
}

void FakeScanService::RollBackSensorProfile(const Actor& actor, const std::string& serial,
                                            int version, Done done) {
  if (serial != profiles.serial)
    return Finish(done, Refusal(ChangeResult::kConflict, "the sensor is not connected"));
  for (SensorProfileVersion one : profiles.versions) {
    if (one.version != version || one.num_sweeps == 0) continue;
    one.version = profiles.versions.front().version + 1;
    one.cause = "rolled_back";
    profiles.versions.insert(profiles.versions.begin(), one);
    return Did(actor, "profile.roll_back", serial, done);
  }
  Finish(done, Refusal(ChangeResult::kNotFound, "there is no such version"));
}

void FakeScanService::EndScan() {
  if (is_check_) return EndCheck();
  Scan& scan = scans.back();
  scan.outcome = ScanOutcome::kDone;
  scan.finished_at = WallClock::now();
  if (!recorded.empty()) {
    const Recorded data =
        next_recorded ? *next_recorded : recorded[std::min(num_finished_, recorded.size() - 1)];
    if (!next_recorded) ++num_finished_;
    next_recorded.reset();
    scan.folder = data.folder;
    if (!scan.reference_id.empty()) scan.result = data.result;
  }
  status.scan.reset();
  status.state = ApplianceState::kResult;
  status.light = !scan.result                             ? "done"
                 : scan.result->verdict == "move"         ? "result_move"
                 : scan.result->verdict == "in_tolerance" ? "result_in_tolerance"
                 : scan.result->verdict == "unsure"       ? "result_unsure"
                                                          : "no_answer";
  status.last_result = scan;
  if (status.session) ++status.session->num_scans;
  ++status.scans_today;
  if (Patient* patient = PatientOf(scan.patient_id)) {
    ++patient->num_scans;
    if (scan.purpose == ScanPurpose::kReference) MakeReference(scan, "technician", "");
  }
  Tell(EventKind::kResult);
}

Reference& FakeScanService::MakeReference(const Scan& scan, const std::string& by,
                                          const std::string& reason) {
  Reference reference;
  reference.id = fmt::format("r{:04}", next_id_++);
  reference.patient_id = scan.patient_id;
  reference.version = static_cast<int>(References(scan.patient_id).size()) + 1;
  reference.scan_id = scan.id;
  reference.created_at = WallClock::now();
  reference.created_by = by;
  reference.reason = reason;
  reference.plan.tolerance = settings.tolerance;
  reference.planned_by = by;
  reference.digest = "digest of " + reference.id + " 1";
  references.push_back(reference);
  TellWaiting();
  return references.back();
}

void FakeScanService::Unplug() {
  status.sensor.present = false;
  status.state = ApplianceState::kNoSensor;
  status.light = "no_sensor";
  if (status.scan) {
    if (!is_check_) {
      scans.back().outcome = ScanOutcome::kFailed;
      scans.back().failure = "the sensor was unplugged; the scan is discarded";
    }
    CloseCheck();
    status.scan.reset();
    Tell(EventKind::kResult);
  }
  Tell(EventKind::kStatus);
}

void FakeScanService::Plug() {
  status.sensor.present = true;
  status.state = ApplianceState::kReady;
  status.light = "ready";
  Tell(EventKind::kStatus);
}

std::optional<Patient> FakeScanService::FindPatient(const std::string& id) {
  return FindById(patients, id);
}

void FakeScanService::AddPatient(const Actor& actor, const std::string& code,
                                 const std::string& site, Done done) {
  if (std::any_of(patients.begin(), patients.end(), [&](const Patient& patient) {
        return strcasecmp(patient.code.c_str(), code.c_str()) == 0;
      })) {
    return Finish(done, Refusal(ChangeResult::kConflict, "there is a patient of this code"));
  }
  patients.push_back({fmt::format("p{:04}", next_id_++), code, site, WallClock::now(), "", 0, ""});
  Did(actor, "patient.add", patients.back().id, done, patients.back().id);
}

void FakeScanService::SetTemplate(const Actor& actor, const PlanTemplate& wanted, Done done) {
  std::erase_if(templates, [&](const PlanTemplate& old) {
    return strcasecmp(old.site.c_str(), wanted.site.c_str()) == 0;
  });
  templates.push_back(wanted);
  templates.back().changed_by = actor.user;
  Did(actor, "template.set", "", done);
}

void FakeScanService::RemoveTemplate(const Actor& actor, const std::string& site, Done done) {
  if (std::erase_if(templates, [&](const PlanTemplate& old) {
        return strcasecmp(old.site.c_str(), site.c_str()) == 0;
      }) == 0)
    return Finish(done, Refusal(ChangeResult::kNotFound, "there is no template of this site"));
  Did(actor, "template.remove", "", done);
}

void FakeScanService::ChangePatient(const Actor& actor, const std::string& id,
                                    const std::string& site, const std::string& note, Done done) {
  for (Patient& patient : patients) {
    if (patient.id != id) continue;
    patient.site = site;
    patient.note = note;
    return Did(actor, "patient.change", id, done);
  }
  Finish(done, Refusal(ChangeResult::kNotFound, "there is no such patient"));
}

void FakeScanService::ArchivePatient(const Actor& actor, const std::string& id, bool archived,
                                     Done done) {
  for (Patient& patient : patients) {
    if (patient.id != id) continue;
    if (archived && status.session && status.session->patient_id == id)
      return Finish(done, Refusal(ChangeResult::kConflict,
                                  "the session of this patient is open: close it first"));
    patient.archived = archived;
    return Did(actor, archived ? "patient.archive" : "patient.unarchive", id, done);
  }
  Finish(done, Refusal(ChangeResult::kNotFound, "there is no such patient"));
}

void FakeScanService::WipePatient(const Actor& actor, const std::string& id, Done done) {
  if (std::erase_if(patients, [&](const Patient& patient) { return patient.id == id; }) == 0) {
    return Finish(done, Refusal(ChangeResult::kNotFound, "no such patient"));
  }
  std::erase_if(references, [&](const Reference& reference) { return reference.patient_id == id; });
  std::erase_if(scans, [&](const Scan& scan) { return scan.patient_id == id; });
  if (status.patient_id == id) {
    status.patient_id.clear();
    status.session.reset();
  }
  if (status.last_result && status.last_result->patient_id == id) status.last_result.reset();
  Tell(EventKind::kStatus);
  Did(actor, "patient.wipe", id, done);
}

void FakeScanService::OpenPatient(const Actor& actor, const std::string& id, ScanPurpose purpose,
                                  const std::string&, const std::string& replaces, Done done) {
  const Patient* patient = PatientOf(id);
  if (patient == nullptr) return Finish(done, Refusal(ChangeResult::kNotFound, "no such patient"));
  if (purpose == ScanPurpose::kFraction && patient->approved_reference_id.empty()) {
    return Finish(done, Refusal(ChangeResult::kConflict,
                                "this patient has no approved reference; take one first"));
  }
  if (status.scan) return Finish(done, Refusal(ChangeResult::kConflict, "a scan is running"));
  if (patient->archived)
    return Finish(done, Refusal(ChangeResult::kConflict,
                                "this patient is archived: take it out of the archive first"));
  if (purpose == ScanPurpose::kReference && !status.reference_block.empty())
    return Finish(done, Refusal(ChangeResult::kConflict, status.reference_block));
  CloseCheck();
  if (status.session && status.session->patient_id == id && status.session->purpose == purpose) {
    const std::string same = status.session->id;
    return Did(actor, "patient.open", id, done, same);
  }
  if (status.session && status.session->patient_id != id && status.session->id != replaces) {
    return Finish(done,
                  Refusal(ChangeResult::kConflict,
                          fmt::format("the session of {} is open (opened by {}): close it "
                                      "first",
                                      status.session->patient_code, status.session->opened_by)));
  }
  status.patient_id = id;
  status.next_purpose = purpose;
  status.scans_today = 0;
  const int fraction = purpose == ScanPurpose::kFraction ? ++num_fractions_[id] : 0;
  status.session = TreatmentSession{.id = fmt::format("t{:04}", next_id_++),
                                    .patient_id = id,
                                    .patient_code = patient->code,
                                    .purpose = purpose,
                                    .fraction = fraction,
                                    .num_scans = 0,
                                    .opened_by = actor.user,
                                    .opened_at = WallClock::now()};
  Tell(EventKind::kStatus);
  Did(actor, "patient.open", id, done, status.session->id);
}

void FakeScanService::CloseSession(const Actor& actor, const std::string& session_id, Done done) {
  if (status.scan) return Finish(done, Refusal(ChangeResult::kConflict, "a scan is running"));
  if (!status.session || (!session_id.empty() && status.session->id != session_id))
    return Finish(done, Refusal(ChangeResult::kConflict, "this session is closed already"));
  status.session.reset();
  status.patient_id.clear();
  status.next_purpose = ScanPurpose::kFraction;
  Tell(EventKind::kStatus);
  Did(actor, "session.close", "", done);
}

void FakeScanService::TellWaiting() {
  status.waiting.clear();
  for (Patient& patient : patients) {
    const auto found = References(patient.id);
    patient.draft_reference_id =
        !found.empty() && found.front().approved_by.empty() ? found.front().id : "";
    if (!patient.draft_reference_id.empty())
      status.waiting.push_back(
          {patient.draft_reference_id, patient.id, patient.code, found.front().version});
  }
}

bool FakeScanService::IsOld(const Scan& scan) const {
  return !scan.finished_at || WallClock::now() - *scan.finished_at >
                                  std::chrono::seconds(static_cast<int>(kResultValid_s));
}

void FakeScanService::AddDisplay(const Actor& actor, const Display& display, Done done) {
  displays.push_back(display);
  displays.back().id = fmt::format("d{:04}", next_id_++);
  const std::string id = displays.back().id;
  Did(actor, "display.pair", id, done, id);
}

void FakeScanService::RemoveDisplay(const Actor& actor, const std::string& id, Done done) {
  if (std::erase_if(displays, [&](const Display& display) { return display.id == id; }) == 0)
    return Finish(done, Refusal(ChangeResult::kNotFound, "no such display"));
  Did(actor, "display.remove", id, done);
}

std::vector<Reference> FakeScanService::References(const std::string& patient_id) {
  std::vector<Reference> found;
  std::copy_if(references.rbegin(), references.rend(), std::back_inserter(found),
               [&](const Reference& reference) { return reference.patient_id == patient_id; });
  return found;
}

std::optional<Reference> FakeScanService::FindReference(const std::string& id) {
  return FindById(references, id);
}

void FakeScanService::AddReference(const Actor& actor, const std::string& scan_id,
                                   const std::string& reason, Done done) {
  const auto scan = FindScan(scan_id);
  if (!scan || scan->outcome != ScanOutcome::kDone)
    return Finish(done, Refusal(ChangeResult::kNotFound, "no finished scan of this id"));
  const std::string id = MakeReference(*scan, actor.user, reason).id;
  Did(actor, "reference.add", id, done, id);
}

void FakeScanService::PlanReference(const Actor& actor, const std::string& id, int revision,
                                    const ReferencePlan& plan, Done done) {
  const auto found = std::find_if(references.begin(), references.end(),
                                  [&](const Reference& reference) { return reference.id == id; });
  if (found == references.end())
    return Finish(done, Refusal(ChangeResult::kNotFound, "no such reference"));
  if (found->revision != revision)
    return Finish(done,
                  Refusal(ChangeResult::kConflict, "this plan has been changed by somebody else"));
  if (found->approved_by.empty()) {
    found->plan = plan;
    ++found->revision;
    found->digest = fmt::format("digest of {} {}", id, found->revision);
    found->planned_by = actor.user;
    return Did(actor, "reference.plan", id, done);
  }
  Reference next = *found;
  next.id = fmt::format("r{:04}", next_id_++);
  next.version = static_cast<int>(References(next.patient_id).size()) + 1;
  next.plan = plan;
  next.revision = 1;
  next.created_by = next.planned_by = actor.user;
  next.digest = "digest of " + next.id + " 1";
  next.approved_by.clear();
  next.approved_at.reset();
  references.push_back(next);
  TellWaiting();
  Did(actor, "reference.plan", next.id, done, next.id);
}

void FakeScanService::ApproveReference(const Actor& actor, const std::string& id, int revision,
                                       const std::string& digest, Done done) {
  const auto found = std::find_if(references.begin(), references.end(),
                                  [&](const Reference& reference) { return reference.id == id; });
  if (found == references.end())
    return Finish(done, Refusal(ChangeResult::kNotFound, "no such reference"));
  if (!status.reference_block.empty())
    return Finish(done, Refusal(ChangeResult::kConflict, status.reference_block));
  if (!found->approved_by.empty())
    return Finish(done, Refusal(ChangeResult::kConflict, "this reference is approved already"));
  if (found->revision != revision)
    return Finish(done,
                  Refusal(ChangeResult::kConflict, "this plan has been changed by somebody else"));
  if (!digest.empty() && digest != found->digest)
    return Finish(done, Refusal(ChangeResult::kConflict, "what is stored is not what was shown"));
  if (found->created_by == actor.user || found->planned_by == actor.user) {
    return Finish(done,
                  Refusal(ChangeResult::kRefused,
                          "a second person must approve: you made or planned this reference"));
  }
  found->approved_by = actor.user;
  found->approved_at = WallClock::now();
  if (Patient* patient = PatientOf(found->patient_id)) patient->approved_reference_id = id;
  TellWaiting();
  Did(actor, "reference.approve", id, done);
}

std::vector<Scan> FakeScanService::Scans(const std::string& patient_id, int limit) {
  std::vector<Scan> found;
  for (auto scan = scans.rbegin();
       scan != scans.rend() && found.size() < static_cast<std::size_t>(limit); ++scan) {
    if (patient_id.empty() || scan->patient_id == patient_id) found.push_back(*scan);
  }
  return found;
}

std::optional<Scan> FakeScanService::FindScan(const std::string& id) { return FindById(scans, id); }

void FakeScanService::RemoveScan(const Actor& actor, const std::string& id, const std::string&,
                                 Done done) {
  for (const Reference& reference : references) {
    if (reference.scan_id == id)
      return Finish(done, Refusal(ChangeResult::kConflict, "a reference is made of this scan"));
  }
  if (std::erase_if(scans, [&](const Scan& scan) { return scan.id == id; }) == 0)
    return Finish(done, Refusal(ChangeResult::kNotFound, "there is no such scan"));
  Tell(EventKind::kData);
  Did(actor, "scan.remove", id, done);
}

void FakeScanService::MakeBackup(const Actor& actor, Done done) {
  if (!backup_fault.empty()) return Finish(done, Refusal(ChangeResult::kInvalid, backup_fault));
  Did(actor, "backup.make", "", done);
}

void FakeScanService::AcceptScan(const Actor& actor, const std::string& id,
                                 const std::string& reason, Done done) {
  const auto found =
      std::find_if(scans.begin(), scans.end(), [&](const Scan& scan) { return scan.id == id; });
  if (found == scans.end()) return Finish(done, Refusal(ChangeResult::kNotFound, "no such scan"));
  const auto refuse = [&](const char* why) { Finish(done, Refusal(ChangeResult::kConflict, why)); };
  if (status.scan) return refuse("a scan is running: accept its result, not an older one");
  if (!found->result || found->result->verdict == "no_answer")
    return refuse("there is nothing to accept");
  if (IsOld(*found)) return refuse("this result is older than 2 minutes: scan again");
  if (std::any_of(found + 1, scans.end(), [&](const Scan& scan) {
        return scan.patient_id == found->patient_id && scan.outcome == ScanOutcome::kDone;
      }))
    return refuse("there is a newer scan of this patient: accept that one");
  if (found->result->verdict != "in_tolerance" && reason.empty())
    return refuse("this result is not in tolerance: accepting it requires a reason");
  found->accepted_by = actor.user;
  found->accepted_reason = reason;
  if (status.last_result && status.last_result->id == id) status.last_result = *found;
  Did(actor, reason.empty() ? "scan.accept" : "scan.accept_outside", id, done);
}

std::optional<User> FakeScanService::FindUser(const std::string& name) {
  const auto found =
      std::find_if(users.begin(), users.end(), [&](const User& user) { return user.name == name; });
  return found == users.end() ? std::nullopt : std::optional(*found);
}

void FakeScanService::AddUser(const Actor& actor, const User& user, Done done) {
  if (FindUser(user.name))
    return Finish(done, Refusal(ChangeResult::kConflict, "this name is taken"));
  users.push_back(user);
  Did(actor, "user.add", user.name, done);
}

void FakeScanService::ChangeUser(const Actor& actor, const UserChange& change, Done done) {
  const auto found = std::find_if(users.begin(), users.end(),
                                  [&](const User& other) { return other.name == change.name; });
  if (found == users.end()) return Finish(done, Refusal(ChangeResult::kNotFound, "no such user"));
  if (change.expected_hash && (found->disabled || found->password_hash != *change.expected_hash))
    return Finish(done, Refusal(ChangeResult::kConflict,
                                "the account has been changed by somebody else meanwhile"));
  User user = *found;
  user.role = change.role.value_or(user.role);
  user.disabled = change.disabled.value_or(user.disabled);
  user.password_hash = change.password_hash.value_or(user.password_hash);
  const bool engineer_left = std::any_of(users.begin(), users.end(), [&](const User& other) {
    const User& after = other.name == user.name ? user : other;
    return after.role == Role::kEngineer && !after.disabled;
  });
  if (!engineer_left)
    return Finish(done, Refusal(ChangeResult::kConflict, "one engineer must remain"));
  *found = user;
  Did(actor, "user.change", user.name, done);
}

void FakeScanService::Log(const Actor& actor, const std::string& action, const std::string& subject,
                          const std::string& detail) {
  audit.push_back({static_cast<std::int64_t>(audit.size()) + 1, WallClock::now(), actor.user,
                   actor.address, action, subject, detail});
}

std::vector<AuditEntry> FakeScanService::Audit(std::int64_t before, int limit) {
  std::vector<AuditEntry> found;
  for (auto entry = audit.rbegin();
       entry != audit.rend() && found.size() < static_cast<std::size_t>(limit); ++entry) {
    if (before == 0 || entry->number < before) found.push_back(*entry);
  }
  return found;
}

void FakeScanService::ChangeSettings(const Actor& actor, const Settings& changed, Done done) {
  settings = changed;
  Did(actor, "settings.change", "", done);
}

bool FakeScanService::Later(web::Aside, std::function<void()> aside, std::function<void()> done) {
  if (refuse_aside) return false;
  const auto both = [aside = std::move(aside), done = std::move(done)] {
    aside();
    done();
  };
  if (hold_aside) {
    held_aside.push_back(both);
  } else {
    both();
  }
  return true;
}

void FakeScanService::AddBundle(const Actor& actor, const std::filesystem::path& file,
                                const std::string& name, Done done) {
  std::ifstream in(file, std::ios::binary);
  std::string magic(4, ' ');
  in.read(magic.data(), 4);
  if (magic != "hsqs")
    return Finish(
        done, Refusal(ChangeResult::kInvalid, name + " is no bundle: expected a squashfs image"));
  uploaded_bytes = std::filesystem::file_size(file);
  update.bundles.push_back(name);
  Tell(EventKind::kUpdate);
  Did(actor, "update.upload", name, done);
}

void FakeScanService::RemoveBundle(const Actor& actor, const std::string& name, Done done) {
  if (std::erase(update.bundles, name) == 0)
    return Finish(done, Refusal(ChangeResult::kNotFound, "there is no such bundle"));
  Tell(EventKind::kUpdate);
  Did(actor, "update.remove", name, done);
}

void FakeScanService::InstallUpdate(const Actor& actor, const std::string& bundle, Done done) {
  if (status.scan)
    return Finish(done, Refusal(ChangeResult::kConflict, "a scan is running; update after it"));
  if (!update.supported) return Finish(done, Refusal(ChangeResult::kConflict, update.message));
  update.installing = true;
  update.fraction = 0.4;
  update.message = "Copying image to rootfs.1";
  Tell(EventKind::kUpdate);
  Did(actor, "update.install", bundle, done);
}

void FakeScanService::RestartSystem(const Actor& actor, Done done) {
  const auto refuse = [&](const char* why) { Finish(done, Refusal(ChangeResult::kConflict, why)); };
  if (update.installing) return refuse("a system update is being installed: wait until it is done");
  if (status.scan) return refuse("a scan is running: wait for its result");
  if (status.session) return refuse("the session of a patient is open: close it first");
  ++num_restarts;
  Did(actor, "system.restart", "", done);
}

void FakeScanService::ForgetRollBack(const Actor& actor, Done done) {
  status.rolled_back.clear();
  update.rolled_back.clear();
  Tell(EventKind::kUpdate);
  Tell(EventKind::kStatus);
  Did(actor, "update.seen", "", done);
}

void FakeScanService::WriteDiagnostics(const Actor& actor, Done done) {
  Log(actor, "diagnostics", "", "");
  Finish(done, {ChangeResult::kDone, "", "", diagnostics_file});
}

}  // namespace plumb::test
