// SPDX-License-Identifier: Apache-2.0
#include "tests/web/commands.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <memory>
#include <sstream>

#include "algo/base/units.hpp"
#include "daemon/files/compact_map.hpp"
#include "drivers/files/image_file.hpp"
#include "words/check.hpp"
#include "words/dicom.hpp"
#include "words/monitoring.hpp"
#include "words/peers.hpp"
#include "words/scan.hpp"
#include "words/store.hpp"
#include "words/update.hpp"
#include "words/upkeep.hpp"

namespace plumb::test {
namespace {

/// As plumbd gives it.
nlohmann::ordered_json MonitorReportOf(const std::string& scan) {
  const nlohmann::ordered_json axis = {{"least", -0.6}, {"most", 1.4}, {"last", 0.3}};
  nlohmann::ordered_json motion;
  for (const NumberAxis& one : kNumberAxes) motion[one.key] = axis;
  return {
      {"head", {{"scan", scan}, {"judges", "since_zero"}, {"started_at", "2026-06-01T09:30:00Z"}}},
      {"is_cut_off", true},
      {"frames", 9000},
      {"seconds", 300.0},
      {"states_s", {{"mounting", 2.0}, {"zeroing", 8.6}, {"monitoring", 280.0}, {"blind", 9.4}}},
      {"advice_s", {{"in", 261.0}, {"out", 19.0}, {"unknown", 9.4}}},
      {"gaps_s", 0.4},
      {"holds", 2},
      {"drift", {{"least", 0.9998}, {"most", 1.0011}, {"last", 1.0009}}},
      {"since_zero", motion},
      {"against_reference", nullptr},
      {"num_events", 3},
      {"events",
       {{{"time_s", 0.0}, {"event", "mounting"}},
        {{"time_s", 12.0}, {"event", "advice_in"}},
        {{"time_s", 100.0}, {"event", "blind"}, {"reason", "covered"}}}},
      {"said", {{{"event", "zero"}, {"breathing", {{"amplitude_mm", 4.5}, {"period_s", 3.8}}}}}}};
}

/// A plan with its structure set, one without, another patient's and one that cannot be read.
Received SomeReceived(const FakeAppliance& service) {
  const auto file = [](const char* name, ReceivedKind kind, const char* label) {
    return ReceivedFile{.name = name,
                        .kind = kind,
                        .received_at = "2026-03-01T09:30:00Z",
                        .sender = "PLANNING",
                        .address = "192.168.1.20",
                        .bytes = 5000,
                        .label = label};
  };
  Received received{
      .is_on = true,
      .files = {file("e", ReceivedKind::kPlan, "BREAST LEFT 2"),
                file("d", ReceivedKind::kPlan, "PELVIS"), file("c", ReceivedKind::kOther, ""),
                file("b", ReceivedKind::kPlan, "THORAX"),
                file("a", ReceivedKind::kStructures, "THORAX CT")},
      .series = {{.uid = "2.25.7",
                  .frame_uid = "2.25.8",
                  .received_at = "2026-03-01T09:31:00Z",
                  .sender = "PLANNING",
                  .address = "192.168.1.20",
                  .images = 61}},
      .images = 98};
  received.files[1].structures = received.files[3].structures = "a";
  received.files[3].has_skin = true;
  received.files[0].series = {"2.25.7"};
  received.files[1].patient_id = "other";
  received.files[1].patient_code = "CT-2";
  received.files[2].fault = say::dicom::CannotRead();
  const auto owner = std::ranges::find(service.patients, "CT-1", &Patient::code);
  if (owner != service.patients.end()) {
    received.files[3].patient_id = owner->id;
    received.files[3].patient_code = owner->code;
  }
  return received;
}

/// Of the sensor and of sweeps.
void ObeySensor(FakeAppliance& service, const std::string& name, std::istream& words) {
  if (name == "unplug") service.Unplug();
  if (name == "plug") service.Plug();
  if (name == "fail") service.Fail("the recording cannot be written");
  if (name == "press") service.Press({"button", ""}, [](const Change&) {});
  if (name == "guide") {  // none: as the sweep goes
    static const std::map<std::string, SweepAdvice> kGuidance = {
        {"good", SweepAdvice::kNone},         {"slower", SweepAdvice::kSlower},
        {"closer", SweepAdvice::kCloser},     {"farther", SweepAdvice::kFarther},
        {"lost", SweepAdvice::kTrackingLost}, {"too_slow", SweepAdvice::kComputerTooSlow},
        {"enough", SweepAdvice::kEnough}};
    std::string what;
    words >> what;
    service.guidance.reset();
    if (kGuidance.contains(what)) service.guidance = kGuidance.at(what);
  }
  if (name == "slow") service.sweep = std::chrono::milliseconds(60000);
  if (name == "fast") service.sweep = std::chrono::milliseconds(1500);
  if (name == "swift") {
    service.sweep = std::chrono::milliseconds(300);
    service.work = std::chrono::milliseconds(200);
  }
  if (name == "toil") service.work = std::chrono::milliseconds(60000);
  if (name == "camera") {  // a picture of stripes
    cv::Mat picture(240, 320, CV_8UC3);
    for (int row = 0; row < picture.rows; ++row)
      picture.row(row).setTo(cv::Scalar(row, 120, 255 - row));
    const std::vector<std::uint8_t> jpeg = EncodeJpeg(picture, 70);
    service.preview = std::make_shared<const std::string>(jpeg.begin(), jpeg.end());
  }
  if (name == "outline") {  // placed, waits, outside, other (of another reference), or none
    std::string what;
    words >> what;
    service.outline.reset();
    if (what != "none" && service.preview) {
      CameraOutline& outline = service.outline.emplace();
      outline.jpeg = *service.preview;
      if (const auto& session = service.status.session; session && session->reference)
        outline.reference = what == "other" ? "another" : session->reference->id;
      outline.is_placed = what != "waits";
      if (what == "placed")
        outline.lines = {{{0.3F, 0.2F}, {0.7F, 0.25F}, {0.8F, 0.7F}, {0.25F, 0.75F}, {0.3F, 0.2F}},
                         {{0.4F, 1.0F}, {0.5F, 0.85F}, {0.6F, 1.0F}}};
    }
  }
  if (name == "cold" || name == "warm") {
    service.status.sensor.powered_s = name == "cold" ? 1020 : 1800;
    service.status.reference_block = name == "cold" ? say::scan::IsWarmingUp(20) : Message();
    service.Notify(web::EventKind::kStatus);
  }
}

/// Of the unit, its updates and its disk.
void ObeyUnit(FakeAppliance& service, const std::string& name) {
  if (name == "encrypts") service.encrypts_backups = true;
  if (name == "nobackup") {
    service.backup_fault = "no folder for backups is configured";
    service.status.storage.warnings = {say::upkeep::BackupFailed(say::upkeep::NoBackupFolder())};
    service.Notify(web::EventKind::kStatus);
  }
  if (name == "installed") {
    service.update.installing = false;
    service.update.message = say::update::Installed("plumb-0.3.0.raucb");
    service.update.restart_needed = true;
    service.Notify(web::EventKind::kUpdate);
  }
  if (name == "rolledback") {
    service.update.restart_needed = false;
    service.update.rolled_back = say::update::RolledBack("0.3.0", "0.2.0");
    service.status.rolled_back = service.update.rolled_back;
    service.Notify(web::EventKind::kUpdate);
    service.Notify(web::EventKind::kStatus);
  }
  if (name == "full" || name == "emptied") {
    const bool is_full = name == "full";
    service.status.state = is_full ? ApplianceState::kFault : ApplianceState::kReady;
    service.status.fault_kind = is_full ? FaultKind::kStorage : FaultKind::kNone;
    service.status.fault = is_full ? say::upkeep::DiskFull(90, 700) : Message();
    service.Notify(web::EventKind::kStatus);
  }
  if (name == "restarted") {  // the appliance: what was measured before is known by the store alone
    service.status.last_result.reset();
    service.Notify(web::EventKind::kStatus);
  }
  if (name == "plugged") {
    service.stick.push_back("plumb-0.5.0.raucb");
    service.Notify(web::EventKind::kUpdate);
  }
  if (name == "old" && !service.scans.empty()) {
    service.scans.back().finished_at = WallClock::now() - std::chrono::minutes(10);
    service.status.last_result = service.scans.back();
    service.Notify(web::EventKind::kResult);
  }
}

/// Of what came over the network.
void ObeyReceived(FakeAppliance& service, const std::string& name, std::istream& words) {
  if (name == "received") service.received = SomeReceived(service);
  if (name == "worklist") {  // PATIENT: at half past nine, beside two strangers
    std::string patient;
    words >> patient;
    const auto known = service.FindPatient(patient);
    service.worklist = {.is_on = true, .patients = {}, .unknown = 2};
    if (known)
      service.worklist.patients = {
          {.time = "09:30", .patient_id = known->id, .patient_code = known->code}};
  }
  if (name == "foreignfiles") service.planning_doubt = say::store::PlanningPatientDiffers(1);
}

/// Of checks and of the room.
void ObeyRoom(FakeAppliance& service, const std::string& name, std::istream& words) {
  if (name == "markermoved") {
    CheckRecord check;
    check.reasons = {say::check::Moved(7, 12.0), say::check::Misfit(3.4, 3.0)};
    check.items = {{"markers_seen", 12, 12, "", true, {}},
                   {"misfit", 3.4, 3, "mm", false, {}},
                   {"moved", 12.2, 5, "mm", false, say::check::Marker(7)},
                   {"scale", 0.08, 0.5, "%", true, {}},
                   {"side", -0.4, 3, "%", true, say::check::Marker(9)},
                   {"depth_scale", 0.62, 3, "%", true, {}}};
    check.num_markers = 12;
    service.next_check = check;
  }
  if (name == "markerunseen") {
    CheckRecord check;
    check.status = MarkerCheckStatus::kPassed;
    check.cautions = {say::check::NotChecked(1, {4})};
    check.items = {{"markers_seen", 11, 10, "", true, say::check::Missing({4})},
                   {"misfit", 0.84, 3, "mm", true, {}}};
    check.num_markers = 11;
    service.next_check = check;
  }
  if (name == "room") {
    std::string what;
    words >> what;
    service.status.room.is_known = what != "unknown";
    service.room_of_references.reset();
    // As if each reference's marker had been turned by 90 degrees before the room was calibrated.
    const auto turned = [](const std::array<double, 2>& way) {
      return std::array<double, 2>{-way[1], way[0]};
    };
    if (const RoomOnMap& room = service.status.room; what == "turned")
      service.room_of_references = {
          .gantry_xy = turned(room.gantry_xy), .right_xy = turned(room.right_xy), .is_known = true};
    if (what == "lasers") {
      service.room_of_references = service.status.room;
      service.room_of_references->lasers_m = {0.61, 0.44, 0.05};
    }
    if (what == "contradicts") {
      service.room_of_references = service.status.room;
      service.room_of_references->contradicts_posture = true;
    }
    service.Notify(web::EventKind::kStatus);
  }
  if (name == "board") service.is_board_there = true;
  if (name == "roomdue") {
    service.room.due = say::store::RoomMarkerMoved(say::check::Marker(4), 8.0);
    service.Notify(web::EventKind::kData);
  }
  if (name == "peers") {  // WHAT: of the other unit: open, silent or nothing
    std::string what;
    words >> what;
    const std::string unit = "plumb-b.clinic.example:8080";
    service.status.peer_notes.clear();
    if (what == "open") service.status.peer_notes = {say::peers::OpenElsewhere(unit)};
    if (what == "silent") service.status.peer_notes = {say::peers::NotKnown(unit)};
    service.Notify(web::EventKind::kStatus);
  }
  if (name == "overdue") service.SetOverdue(say::scan::CheckOverdue());
  if (name == "checked") service.SetOverdue({});
}

/// A body of 40 by 80 cm that lies higher at its head by this, and lower at its other end.
std::string PackedRise(double rise_mm) {
  constexpr int kCells = 160;
  HeightMap rise({.x_min = -1.6, .y_min = -1.6, .step = 0.02, .width = kCells, .height = kCells});
  std::vector<std::uint8_t> missing(rise.z.size(), 0);
  for (int row = 60; row < 100; ++row) {
    for (int column = 70; column < 90; ++column) {
      rise.at(row, column) = static_cast<float>(rise_mm / 1000 * (row - 80) / 20);
      missing[rise.grid.index(row, column)] = row < 66 ? 1 : 0;
    }
  }
  return CompactHeights(rise, missing);
}

/// Of live monitoring.
void ObeyMonitor(FakeAppliance& service, const std::string& name, std::istream& words) {
  if (name == "breathe") {  // HEIGHT_MM ADVICE: of the breath, while a level is taught
    double height_mm = 0;
    std::string advice;
    words >> height_mm >> advice;
    service.monitor.breathing_mm = height_mm;
    service.monitor.age_s = 0.03;
    if (service.monitor.breath_hold) service.monitor.breath_hold->advice = advice;
    service.Notify(web::EventKind::kMonitor);
  }
  if (name == "alone") {  // [OTHER]: no image comes from that one of two sensors
    std::string other;
    words >> other;
    service.monitor.one_sensor =
        other.empty() ? Message() : say::monitoring::SensorSilent(other, "VIRTUAL-0001");
    service.Notify(web::EventKind::kMonitor);
  }
  if (name == "lies") {  // RISE_MM: how the body lies against its scan; its feet are not seen
    double rise_mm = 0;
    words >> rise_mm;
    service.monitor_map = std::make_shared<const std::string>(PackedRise(rise_mm));
  }
  if (name == "recorded") {  // SCAN: it was monitored, and a power cut ended that
    words >> service.monitored_scan;
    service.monitor_report = MonitorReportOf(service.monitored_scan);
  }
  if (name == "watch") {  // STATE ADVICE REASON VERTICAL_MM: what live monitoring says
    double vertical_mm = 0;
    words >> service.monitor.state >> service.monitor.advice >> service.monitor.reason >>
        vertical_mm;
    const bool knows = service.monitor.state == "monitoring";
    const MotionNumbers numbers{.value = {vertical_mm, -0.4, 0.3, 0.1, -0.05, 0.2},
                                .u95 = {0.2, 0.4, 0.4, 0.1, 0.1, 0.1}};
    service.monitor.judges_reference = true;
    service.monitor.since_zero = knows ? std::optional(numbers) : std::nullopt;
    service.monitor.against_reference = service.monitor.since_zero;
    if (knows) service.monitor.against_reference->value[0] += 1.0;
    service.monitor.age_s = 0.03;
    service.monitor.latency_ms = 42;
    service.monitor.couch_moved = service.monitor.advice == "out";
    service.monitor.has_breathing = knows;
    service.monitor.breathing_mm =
        knows ? std::optional(3.0 +
                              3.0 * std::sin(0.3 * static_cast<double>(service.monitor.frames++)))
              : std::nullopt;
    service.Notify(web::EventKind::kMonitor);
  }
}

/// Of what the next scan shows.
void ObeyShown(FakeAppliance& service, Recorder& recorder, const std::string& name,
               std::istream& words) {
  if (name == "stranger") service.next_recorded = recorder.Once(name, Stranger);
  if (name == "across") service.next_recorded = recorder.RecordAcross();
  if (name == "hole") service.next_recorded = recorder.Record(WithHole());
  if (name == "shifted")
    service.next_recorded = recorder.RecordChanged(LyingRight(8), [](Scene& scene) {
      for (Eigen::Vector3d& corner : scene.markers.at(3).corners) corner.x() += 12 * kMillimetre;
    });
  if (name == "weak") service.next_recorded = recorder.RecordWeak();
  if (name == "hurried" || name == "halflost" || name == "mostlost")
    service.next_recorded = recorder.RecordChanged(LyingRight(9), [name](Scene& scene) {
      scene.frames_total = 300;
      scene.frames_dropped = name == "hurried" ? 100 : name == "halflost" ? 150 : 151;
      scene.frames_tracked = scene.frames_total - scene.frames_dropped;
    });
  if (name == "shoulder") service.next_recorded = recorder.Record(LiftedShoulder());
  if (name == "moved") {
    std::string axis, posture;
    double amount = 0;
    words >> axis >> amount >> posture;
    std::string room;  // "bare": the room's directions were never set
    words >> room;
    service.next_recorded = recorder.RecordMotion(axis, amount, posture, room != "bare");
  }
  if (name == "tolerated" || name == "unsure") {
    FakeAppliance::Recorded shown = recorder.RecordMotion("z", 0, "HFS");
    ResultSummary& result = *shown.result;
    result.verdict = name == "unsure" ? Verdict::kUnsure : Verdict::kInTolerance;
    if (name == "unsure") {
      result.correction->vertical_mm = -2.8;
      result.u95->vertical_mm = 1.2;
      result.correction->pitch_deg = 0.01;
      result.u95->pitch_deg = 0.14;
      result.judgements[0] = NumberJudgement::kUnsure;
    }
    service.next_recorded = shown;
  }
}

}  // namespace

void Obey(FakeAppliance& service, Recorder& recorder, const std::string& command) {
  std::istringstream words(command);
  std::string name;
  words >> name;
  ObeySensor(service, name, words);
  ObeyUnit(service, name);
  ObeyReceived(service, name, words);
  ObeyRoom(service, name, words);
  ObeyMonitor(service, name, words);
  ObeyShown(service, recorder, name, words);
}

}  // namespace plumb::test
