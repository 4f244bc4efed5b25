// SPDX-License-Identifier: Apache-2.0
// The real HTTP server over a fake appliance whose scans show real results: for tests of the page
// in a browser. plumb_web_test_server FOLDER: makes scenes and results in FOLDER, prints its
// address and "setup code: XXXX-XXXX", obeys lines on stdin: unplug, plug, fail (of the running
// scan), nobackup (backups fail), overdue (no check has passed, references are blocked), checked,
// slow (long sweeps), fast, toil (long computing), swift (half a second from the start to the
// result), old (the last result becomes 10 minutes old), restarted (the status names no last
// result), plugged (another bundle is on the stick), quit; of what the next scan shows:
// markermoved (a check), stranger (another body), shoulder (lifted), across (the body lies across
// the room's axes), "moved AXIS AMOUNT POSTURE" (the body moved along x, y, z by mm or turned by
// pitch, roll, yaw by degrees); hole (in the region), shifted (one marker, by 12 mm), weak (roll is
// not well seen), hurried (a third of the frames lost); "room known", "room unknown", "room
// lasers": what the status says; "moved z 8 HFS bare": as compared where the room is not known;
// cold, warm (the sensor); full, emptied (the disk); "peers open", "peers silent", "peers nothing".
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <sstream>
#include <string>

#include "algo/base/units.hpp"
#include "algo/comparison/comparison.hpp"
#include "algo/surface/surface_mesh.hpp"
#include "daemon/database/store_json.hpp"
#include "daemon/files/compact_map.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/planning/planning_import.hpp"
#include "daemon/reports/scan_quality.hpp"
#include "daemon/result/result_folder.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/simulator/suites/dicom_writer.hpp"
#include "drivers/simulator/suites/planning_ct.hpp"
#include "drivers/simulator/suites/suite_plan.hpp"
#include "tests/support/fake_appliance.hpp"
#include "tests/support/result_with.hpp"
#include "tests/support/synthetic_scene.hpp"
#include "web/api/http_server.hpp"
#include "words/check.hpp"
#include "words/dicom.hpp"
#include "words/peers.hpp"
#include "words/scan.hpp"
#include "words/store.hpp"
#include "words/update.hpp"
#include "words/upkeep.hpp"

namespace plumb::test {
namespace {

namespace fs = std::filesystem;

/// The couch lies along the marker's x axis, its head end at the gantry.
const Pose kT_iec_reference(Eigen::AngleAxisd(90 * kDegree, Eigen::Vector3d::UnitZ()));
const Eigen::Vector3d kCentre(0.6, 0.45, 0.0);

CompareOptions Options() {
  CompareOptions options;
  options.T_iec_reference = kT_iec_reference;
  return options;
}

SyntheticOptions At(const Pose& T_motion, unsigned seed, double noise_m) {
  SyntheticOptions options;
  options.T_reference_body = T_motion * Pose(Eigen::Translation3d(kCentre));
  options.seed = seed;
  options.noise_m = noise_m;
  return options;
}

/// By a sensor that is known well: its numbers have digits behind the point.
Scene SceneOf(const SyntheticOptions& options) {
  Scene scene = MakeSyntheticScene(options);
  scene.sensitivity = KnownCalibration(scene);
  return scene;
}

constexpr int kNumSweeps = 4;

/// What the sweeps show in turn: a body, carried, lying right, with its markers covered.
SyntheticOptions Sweep(int number) {
  if (number == 0) return At(Pose::Identity(), 1, 0.0);
  if (number == 1)
    return At(BodyMotionAbout(kCentre, {0.0062, -0.0124, 0.0041}, -2.4, 0.6, -0.5), 2, 0.0008);
  SyntheticOptions right = At(BodyMotionAbout(kCentre, {0.0006, -0.0004, 0.0003}, 0.05), 3, 0.0008);
  if (number == 2) return right;
  for (const auto& [id, marker] : MakeSyntheticScene(Sweep(0)).markers)
    right.hidden_markers.insert(id);
  right.hidden_markers.erase(right.hidden_markers.begin());
  return right;
}

/// Another person in the place of the one of the reference.
SyntheticOptions Stranger() {
  SyntheticOptions stranger = At(Pose::Identity(), 4, 0.0008);
  stranger.shape = BodyShape::kTorsoWide;
  return stranger;
}

/// The body lies right, but its left side is lifted at the head end (x to the head, y to the right
/// of who lies on the back).
SyntheticOptions LiftedShoulder() {
  SyntheticOptions lifted = At(Pose::Identity(), 5, 0.0008);
  lifted.deform = [](const Eigen::Vector3d& p) {
    const double share =
        std::clamp((p.x() - 0.08) / 0.05, 0.0, 1.0) * std::clamp((-p.y() - 0.01) / 0.04, 0.0, 1.0);
    return Eigen::Vector3d(0, 0, 0.016 * share);
  };
  return lifted;
}

/// A square of 12 cm on the body was not swept over.
SyntheticOptions WithHole() {
  SyntheticOptions hole = At(Pose::Identity(), 7, 0.0008);
  hole.hidden = [](const Eigen::Vector3d& p) {
    return (p - kCentre).head<2>().cwiseAbs().maxCoeff() < 0.06;
  };
  return hole;
}

class Recorder {
 public:
  explicit Recorder(fs::path root) : root_(std::move(root)) {}

  /// The first one is the reference of all others.
  FakeAppliance::Recorded Record(const SyntheticOptions& options) {
    Scene scene = SceneOf(options);
    if (scene.height_map) scene.mesh = MeshOfHeightMap(*scene.height_map, {}, {.decimation = 3});
    const fs::path folder = NewFolder();
    WriteScene(scene, folder / "scene");
    if (!reference_) {
      reference_ = std::move(scene);
      return {folder, std::nullopt};
    }
    return Write(folder, Compare(*reference_, scene, Options()));
  }

  /// As Record(), but only the first time that something of this name is shown.
  FakeAppliance::Recorded Once(const std::string& name,
                               const std::function<SyntheticOptions()>& options) {
    const auto made = made_.find(name);
    return made != made_.end() ? made->second
                               : made_.emplace(name, Record(options())).first->second;
  }

  [[nodiscard]] const Scene& reference() const { return *reference_; }

  /// As Record(), of a scene that something was done to.
  FakeAppliance::Recorded RecordChanged(const SyntheticOptions& options,
                                        const std::function<void(Scene&)>& change) {
    Scene scene = SceneOf(options);
    change(scene);
    const fs::path folder = NewFolder();
    WriteScene(scene, folder / "scene");
    return Write(folder, Compare(*reference_, scene, Options()));
  }

  /// A motion whose roll the surface hardly determines.
  FakeAppliance::Recorded RecordWeak() {
    if (!still_) still_ = Compare(*reference_, SceneOf(At(Pose::Identity(), 6, 0.0)), Options());
    Comparison comparison = *still_;
    comparison.motion->weak_directions = {{.name = "roll", .u95 = 0.9, .unit = "deg"}};
    const fs::path folder = NewFolder();
    fs::create_directory_symlink(root_ / "sweep_0" / "scene", folder / "scene");
    return Write(folder, comparison);
  }

  /// A moved body, in a room whose axes are turned by 90 degrees: the plan's posture is not its
  /// own.
  FakeAppliance::Recorded RecordAcross() {
    Scene scene = SceneOf(Sweep(1));
    if (scene.height_map) scene.mesh = MeshOfHeightMap(*scene.height_map, {}, {.decimation = 3});
    CompareOptions across = Options();
    across.T_iec_reference = Pose::Identity();
    const fs::path folder = NewFolder();
    WriteScene(scene, folder / "scene");
    return Write(folder, Compare(*reference_, scene, across));
  }

  /// A result of which the body's motion in the room is known: `along` the axis (mm), or about it
  /// (degrees).
  FakeAppliance::Recorded RecordMotion(const Eigen::Vector3d& axis, bool is_turn, double amount,
                                       PatientPosture posture, bool is_room_known) {
    if (!still_) still_ = Compare(*reference_, SceneOf(At(Pose::Identity(), 6, 0.0)), Options());
    const Eigen::Vector3d isocentre = kT_iec_reference * still_->motion->centroid_m;
    const Pose T_room = is_turn ? Eigen::Translation3d(isocentre) *
                                      Pose(Eigen::AngleAxisd(amount * kDegree, axis)) *
                                      Eigen::Translation3d(-isocentre)
                                : Pose(Eigen::Translation3d(amount * kMillimetre * axis));
    Comparison comparison = *still_;
    comparison.motion->T = kT_iec_reference.inverse() * T_room * kT_iec_reference;
    comparison.correction =
        CorrectionOf(comparison.motion->T, comparison.motion->covariance,
                     comparison.motion->centroid_m, comparison.motion->centroid_m,
                     is_room_known ? std::optional(kT_iec_reference) : std::nullopt,
                     MarkerKind::kRoom, posture, comparison.body_parts->patient);
    if (!is_room_known) comparison.body_parts->room.reset();
    comparison.judgements = testing::JudgementsOf(Stored(comparison));
    std::array<bool, 6> all{};
    all.fill(true);
    comparison.verdict = VerdictOf(comparison.judgements, all);
    comparison.reasons = {Message::Verbatim("known motion")};
    const fs::path folder = NewFolder();
    fs::create_directory_symlink(root_ / "sweep_0" / "scene", folder / "scene");
    return Write(folder, comparison);
  }

 private:
  fs::path NewFolder() {
    const fs::path folder = root_ / fmt::format("sweep_{}", num_folders_++);
    fs::create_directories(folder);
    return folder;
  }

  FakeAppliance::Recorded Write(const fs::path& folder, const Comparison& comparison) {
    WriteResult(comparison, DrawResult(comparison, &*reference_->height_map), folder / "result");
    return {folder, SummaryOf(ResultText(Stored(comparison)))};
  }

  fs::path root_;
  int num_folders_ = 0;
  std::optional<Scene> reference_;
  std::optional<Comparison> still_;
  std::map<std::string, FakeAppliance::Recorded> made_;  ///< By the name of what they show.
};

/// What a sweep from low to high x has seen of the body after that share of it, as plumbd packs it.
std::string SurfaceAt(const Scene& scene, double share, bool has_region) {
  const HeightMap& seen = *scene.height_map;
  HeightMap shown({.x_min = -1.6, .y_min = -1.6, .step = 0.02, .width = 160, .height = 160});
  std::vector<std::uint8_t> missing(shown.z.size(), 0);
  for (int row = 0; row < seen.grid.height; ++row) {
    for (int column = 0; column < seen.grid.width; ++column) {
      const float z = seen.at(row, column);
      const auto cell = shown.grid.cell(seen.grid.x_centre(column), seen.grid.y_centre(row));
      if (std::isnan(z) || !cell) continue;
      if (column < share * seen.grid.width)
        shown.z[*cell] = z;
      else if (has_region && z > 0.03F)
        missing[*cell] = 1;
    }
  }
  return CompactHeights(shown, missing);
}

/// "x" is to the right of who faces the gantry, "y" to the gantry, "z" up; "pitch", "roll", "yaw"
/// are turns about them.
FakeAppliance::Recorded Moved(Recorder& recorder, const std::string& axis, double amount,
                              const std::string& posture, bool is_room_known = true) {
  const std::string names[] = {"x", "y", "z", "pitch", "roll", "yaw"};
  const auto which = std::find(std::begin(names), std::end(names), axis) - std::begin(names);
  PatientPosture lies = PatientPosture::kHeadFirstSupine;
  for (const PatientPosture known :
       {PatientPosture::kHeadFirstProne, PatientPosture::kFeetFirstSupine,
        PatientPosture::kFeetFirstProne}) {
    if (posture == Name(known)) lies = known;
  }
  return recorder.RecordMotion(Eigen::Vector3d::Unit(which % 3), which >= 3, amount, lies,
                               is_room_known);
}

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
      .images = 98};
  received.files[1].structures = received.files[3].structures = "a";
  received.files[1].patient_id = "other";
  received.files[1].patient_code = "CT-2";
  received.files[2].fault = say::dicom::CannotRead();
  if (!service.patients.empty()) {
    received.files[3].patient_id = service.patients.back().id;
    received.files[3].patient_code = service.patients.back().code;
  }
  return received;
}

void Obey(FakeAppliance& service, Recorder& recorder, const std::string& command) {
  std::istringstream words(command);
  std::string name;
  words >> name;
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
  if (name == "camera") {  // a picture of stripes
    cv::Mat picture(240, 320, CV_8UC3);
    for (int row = 0; row < picture.rows; ++row)
      picture.row(row).setTo(cv::Scalar(row, 120, 255 - row));
    const std::vector<std::uint8_t> jpeg = EncodeJpeg(picture, 70);
    service.preview = std::make_shared<const std::string>(jpeg.begin(), jpeg.end());
  }
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
  if (name == "stranger") service.next_recorded = recorder.Once(name, Stranger);
  if (name == "across") service.next_recorded = recorder.RecordAcross();
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
  if (name == "cold" || name == "warm") {
    service.status.sensor.powered_s = name == "cold" ? 1020 : 1800;
    service.status.reference_block = name == "cold" ? say::scan::IsWarmingUp(20) : Message();
    service.Notify(web::EventKind::kStatus);
  }
  if (name == "full" || name == "emptied") {
    const bool is_full = name == "full";
    service.status.state = is_full ? ApplianceState::kFault : ApplianceState::kReady;
    service.status.fault_kind = is_full ? FaultKind::kStorage : FaultKind::kNone;
    service.status.fault = is_full ? say::upkeep::DiskFull(90, 700) : Message();
    service.Notify(web::EventKind::kStatus);
  }
  if (name == "breathe") {  // HEIGHT_MM ADVICE: of the breath, while a level is taught
    double height_mm = 0;
    std::string advice;
    words >> height_mm >> advice;
    service.monitor.breathing_mm = height_mm;
    service.monitor.age_s = 0.03;
    if (service.monitor.breath_hold) service.monitor.breath_hold->advice = advice;
    service.Notify(web::EventKind::kMonitor);
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
  if (name == "hole") service.next_recorded = recorder.Record(WithHole());
  if (name == "shifted")
    service.next_recorded =
        recorder.RecordChanged(At(Pose::Identity(), 8, 0.0008), [](Scene& scene) {
          for (Eigen::Vector3d& corner : scene.markers.at(3).corners)
            corner.x() += 12 * kMillimetre;
        });
  if (name == "weak") service.next_recorded = recorder.RecordWeak();
  if (name == "hurried" || name == "halflost" || name == "mostlost")
    service.next_recorded =
        recorder.RecordChanged(At(Pose::Identity(), 9, 0.0008), [name](Scene& scene) {
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
    service.next_recorded = Moved(recorder, axis, amount, posture, room != "bare");
  }
  if (name == "tolerated" || name == "unsure") {
    FakeAppliance::Recorded shown = Moved(recorder, "z", 0, "HFS");
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

/// Lines that have come on stdin; "quit" once it is closed.
std::vector<std::string> ReadCommands(std::string& rest) {
  std::array<char, 1024> buffer{};
  const ssize_t count = read(STDIN_FILENO, buffer.data(), buffer.size());
  if (count <= 0) return {"quit"};
  rest.append(buffer.data(), static_cast<std::size_t>(count));
  std::vector<std::string> lines;
  for (std::size_t end; (end = rest.find('\n')) != std::string::npos; rest.erase(0, end + 1))
    lines.push_back(rest.substr(0, end));
  return lines;
}

/// Of a sensor whose fourth sweep showed another focal length.
SensorProfiles KnownSensor() {
  const auto learned = [](int version, double focal) {
    const int age_days = 30 - 7 * version;
    return SensorProfileVersion{.version = version,
                                .made_at = WallClock::now() - std::chrono::hours(24 * age_days),
                                .cause = ProfileCause::kLearned,
                                .num_sweeps = version,
                                .values = {{"focal_x_scale", focal},
                                           {"focal_y_scale", focal},
                                           {"depth_scale", 1.0123},
                                           {"depth_offset_m", -0.0042},
                                           {"color_readout_s", 0.0267}}};
  };
  return {.serial = "17110415",
          .why_none = {},
          .versions = {learned(4, 0.981), learned(3, 1.0046), learned(2, 1.0045)}};
}

/// The files of a small planning CT for the browser to send, and the import of what it sends.
void ServePlanning(FakeAppliance& service, const fs::path& root) {
  const simulated::SuitePlan demo = simulated::PlanSuite({});
  const simulated::ScenePlan& scene = demo.scenes.front();
  Pose T_iec_body = scene.T_world_body;
  T_iec_body.pretranslate(Eigen::Vector3d(0, 0, -0.1));
  for (const auto& [name, quirks] :
       {std::pair{"", std::vector<simulated::CtQuirk>{}},
        {"several-", std::vector{simulated::CtQuirk::kSeveralExternal}}}) {
    const auto [structures, plan] =
        simulated::MakePlanningCt(scene.body->surface, T_iec_body, {.quirks = quirks});
    WriteWholeFile(root / (std::string(name) + "structures.dcm"),
                   std::string_view(DicomBytes(structures)));
    WriteWholeFile(root / (std::string(name) + "plan.dcm"), std::string_view(DicomBytes(plan)));
  }
  service.import_planning = [root, number = 0](const web::SentPlanning& sent) mutable {
    const fs::path folder = root / fmt::format("planned-{}", ++number);
    fs::create_directories(folder);
    fs::path structures = sent.file;
    if (sent.file.empty()) {  // received, not sent
      structures = folder / "structures.dcm";
      fs::copy_file(root / "structures.dcm", structures);
      fs::copy_file(root / "plan.dcm", folder / "plan.dcm");
    } else {
      SplitPlanning(sent.file, sent.structures_bytes, folder / "plan.dcm");
    }
    PlanningChoice choice;
    if (!sent.roi.empty()) choice.roi = sent.roi;
    const ReadPlan read = ReadPlanning({.structures = structures,
                                        .plan = folder / "plan.dcm",
                                        .structures_name = "STRUCTURES",
                                        .plan_name = "PLAN"},
                                       choice);
    WriteScene(read.scene, folder / "scene");
    return folder;
  };
}

int Serve(const fs::path& root, bool tls) {
  FakeAppliance service;
  Recorder recorder(root);
  // Each takes a second to make: all but the reference only for tests that show them.
  for (int number = 0; number < kNumSweeps; ++number)
    service.recorded.emplace_back([&recorder, number] {
      return recorder.Once(fmt::format("sweep {}", number), [number] { return Sweep(number); });
    });
  service.recorded.front()();
  service.make_map = [](const fs::path& folder,
                        const std::string& name) -> std::optional<std::string> {
    try {
      return CompactMap(folder, name);
    } catch (const std::exception&) {
      return std::nullopt;
    }
  };
  service.judge_quality = [](const Scan& scan) {
    return QualityOf(scan, FilesOf(scan), /*warm_up_min=*/20);
  };
  service.status.room.right_xy = {kT_iec_reference(0, 0), kT_iec_reference(0, 1)};
  service.status.room.gantry_xy = {kT_iec_reference(1, 0), kT_iec_reference(1, 1)};
  service.status.room.is_known = true;
  ServePlanning(service, root);
  service.sweep = std::chrono::milliseconds(1500);
  service.profiles = KnownSensor();
  service.update.supported = true;
  service.update.message = {};
  service.update.slot = "A";
  service.update.bundles = {"plumb-0.2.0.raucb"};
  web::HttpServerOptions options;
  options.password_memory_bytes = 1 << 20;
  options.password_operations = 1;
  options.upload_folder = root / "updates";
  options.max_upload_bytes = 64 << 20;
  if (tls) {
    options.make_certificate = [authority = web::MakeAuthority({})](const auto now) {
      return web::IssueTlsIdentity(authority, {}, now);
    };
    options.tls = options.make_certificate(std::chrono::system_clock::now());
    options.keep_certificate = [](const web::TlsIdentity&) {};
  }
  web::HttpServer server(service.services(), options);
  fmt::print("{}://127.0.0.1:{}/\nsetup code: {}\n", tls ? "https" : "http", server.port(),
             server.setup_code().value_or(""));
  std::fflush(stdout);
  std::string rest;
  while (true) {
    std::array<pollfd, 2> waiting = {pollfd{server.fd(), POLLIN, 0},
                                     pollfd{STDIN_FILENO, POLLIN, 0}};
    const auto wait = server.timeout();
    poll(waiting.data(), waiting.size(),
         static_cast<int>(std::min<std::int64_t>(wait ? wait->count() : 50, 50)));
    if (waiting[1].revents != 0) {
      for (const std::string& command : ReadCommands(rest)) {
        if (command == "quit") return 0;
        Obey(service, recorder, command);
      }
    }
    service.Tick(std::chrono::steady_clock::now());
    if (service.status.state == ApplianceState::kScanning)
      service.surface = std::make_shared<const std::string>(
          SurfaceAt(recorder.reference(), std::min(1.0, service.swept),
                    service.status.scan->purpose == ScanPurpose::kFraction));
    server.Run();
  }
}

}  // namespace
}  // namespace plumb::test

int main(int argc, char** argv) {
  const bool tls = argc == 3 && std::string_view(argv[2]) == "tls";
  if (argc != 2 && !tls) {
    std::fprintf(stderr, "usage: plumb_web_test_server FOLDER [tls]\n");
    return 2;
  }
  return plumb::test::Serve(argv[1], tls);
}
