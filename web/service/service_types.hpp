// Values that the page shows and changes. Patient codes are pseudonyms; no field holds the name of
// a person who was scanned.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "web/service/reported_numbers.hpp"

namespace plumb::web {

using WallClock = std::chrono::system_clock;

// The names of the values are in names.hpp.
enum class ApplianceState { kNoSensor, kReady, kScanning, kWorking, kResult, kFault };
/// The reason why the appliance cannot scan, or will not be able to once the running scan has
/// ended.
enum class FaultKind {
  kNone,
  kSensor,   ///< The sensor is attached and does not work; ends when it works or is unplugged.
  kScan,     ///< The last scan failed; ends when somebody acknowledges it by a press.
  kStorage,  ///< Nothing can be stored; ends when the storage works again.
};
/// What the person who sweeps should do.
enum class SweepAdvice {
  kNone,
  kSlower,
  kCloser,
  kFarther,
  kTrackingLost,
  kNoMarkers,
  kComputerTooSlow,  ///< Images are lost because they cannot be processed in time.
};
enum class ScanPurpose { kFraction, kReference, kDailyCheck };
enum class ScanOutcome { kRunning, kDone, kCancelled, kFailed };
/// kDisplay: a paired display in the room, which cannot change anything.
enum class Role { kTechnician, kPhysicist, kEngineer, kDisplay };

/// Time for which a result is shown as actionable and can be accepted.
inline constexpr double kResultValid_s = 120.0;

/// The user who requests a change; recorded in the audit log.
struct Actor {
  std::string user;     ///< Name of the account.
  std::string address;  ///< Address of the browser.
};

struct SensorStatus {
  bool present = false;
  std::string serial;
  std::string name;
  double frames_per_second = 0.0;
  double powered_s = 0.0;  ///< Time since it was attached, for warm-up.
  double warm_up_s = 0.0;  ///< Time that it must have been on before a reference scan.
};

/// The running or processed scan.
struct LiveScan {
  std::string id;
  std::string patient_id;
  ScanPurpose purpose = ScanPurpose::kFraction;
  double elapsed_s = 0.0;
  /// 0..1 of the region of the reference (otherwise of the surface seen recently); not set if
  /// unknown.
  std::optional<double> coverage;
  double without_new_surface_s = 0.0;  ///< Time since new surface was last seen.
  SweepAdvice guidance = SweepAdvice::kNone;
  std::int64_t keyframes = 0;
  std::int64_t frames = 0;
  std::int64_t frames_tracked = 0;
  std::int64_t frames_dropped = 0;
  std::string step;            ///< "tracking", then the steps of the reconstructor.
  double step_fraction = 0.0;  ///< 0..1
};

struct StorageStatus {
  std::int64_t free_bytes = 0;
  std::int64_t total_bytes = 0;
  bool writable = true;
  std::vector<std::string> warnings = {};  ///< Sentences for people: nearly full, no backup.
};

struct Tolerance {
  double shift_mm = 3.0;
  double rotation_deg = 1.0;
};

/// Summary of a comparison, short enough for a list. All other data is in result.json.
struct ResultSummary {
  std::string verdict;  ///< "in_tolerance", "unsure", "move" or "no_answer".
  std::vector<std::string> reasons;
  /// The motion to APPLY. With "no_answer" it is for analysis only, never to be shown as advice.
  std::optional<ReportedNumbers> correction;
  std::optional<ReportedNumbers> u95;
  /// Directions of the correction, in the order of kNumberAxes; empty if unknown.
  std::array<std::string, 6> words;
  std::vector<std::string> body_now;    ///< "left shoulder 9 mm high", before any correction.
  std::vector<std::string> body_after;  ///< The same after the correction: the posture.
};

/// State of the daily check for one day and sensor, by the newest check that passed or failed.
enum class DailyCheck : std::uint8_t { kPassed, kOverdue, kFailed };

struct Scan {
  std::string id;
  std::string patient_id;
  std::string reference_id;  ///< Reference of the comparison; empty if there is none.
  ScanPurpose purpose = ScanPurpose::kFraction;
  ScanOutcome outcome = ScanOutcome::kRunning;
  std::string failure;  ///< Reason for a failed or cancelled scan.
  WallClock::time_point started_at;
  std::optional<WallClock::time_point> finished_at;
  std::optional<ResultSummary> result;
  std::string accepted_by;      ///< Empty if not accepted.
  std::string accepted_reason;  ///< Reason for acceptance outside tolerance.
  std::optional<WallClock::time_point> accepted_at;
  std::string session_id;  ///< Treatment session of the scan; empty if there is none.
  int fraction = 0;        ///< Fraction number of that session; 0 if there is none.
  /// Time that the sensor was on when the scan began, for warm-up.
  std::optional<double> sensor_on_s;
  DailyCheck daily_check = DailyCheck::kPassed;  ///< When the scan began.
  std::string sensor_serial = {};                ///< Of the unit that was swept.
  std::string session_by = {};  ///< Who opened its session; empty if there is none.
  /// Time since its end by a monotonic clock; not set if only the wall clock is available.
  std::optional<double> age_s = {};
  std::filesystem::path
      folder;  ///< DIR/scans/ID; contains scene/, result/ and recording/ as far as they exist.
};

/// Whether every value was within tolerance, but not with its uncertainty.
[[nodiscard]] inline bool IsUnsure(const Scan& scan) {
  return scan.result && scan.result->verdict == "unsure";
}

struct Patient {
  std::string id;    ///< Id in the store, never shown.
  std::string code;  ///< The pseudonym that people type and read.
  std::string site;  ///< Region of the body: "thorax".
  WallClock::time_point created_at;
  std::string approved_reference_id;  ///< The reference for fractions; empty if there is none yet.
  std::int64_t num_scans = 0;
  /// The newest draft after the approved one; empty if there is none.
  std::string draft_reference_id;
  std::string note = {};  ///< Note on this course, at most kMaxNote bytes; no name.
  bool archived = false;  ///< Not in the list and not to be opened; nothing is deleted.
};

/// What people write about a patient's course.
struct CourseNotes {
  std::string site, note;
  bool operator==(const CourseNotes&) const = default;
};

/// A patient on the couch, from opening to closing. At most one at a time.
struct TreatmentSession {
  std::string id;
  std::string patient_id;
  std::string patient_code;
  ScanPurpose purpose = ScanPurpose::kFraction;
  int fraction = 0;   ///< 1, 2, ... in sessions for fractions, otherwise 0.
  int num_scans = 0;  ///< Completed in this session.
  std::string opened_by;
  WallClock::time_point opened_at;
};

/// A draft that is to be planned or approved.
struct WaitingReference {
  std::string reference_id;
  std::string patient_id;
  std::string patient_code;
  int version = 1;
  std::string planned_by;  ///< Empty: it is to be planned; otherwise it is to be approved.
};

inline constexpr std::size_t kMaxDisplays = 20;

/// A paired display in the room, which cannot change anything.
struct Display {
  std::string id;
  std::string name;
  std::string token_hash;  ///< Hexadecimal; leaves the service only for the login.
  WallClock::time_point paired_at;
  std::string paired_by;
};

/// Settings by the physicist before a reference is approved.
struct ReferencePlan {
  std::vector<std::array<double, 2>>
      region_m;  ///< Polygon in the reference marker's frame; empty: the segmented body.
  std::optional<std::array<double, 3>>
      isocentre_m;  ///< Reference marker's frame; not set: centroid of the region.
  Tolerance tolerance;
  std::string posture = "HFS";  ///< One of kPostures.
  bool couch_markers = false;   ///< Markers are fixed to the couch: no shifts are calculated.
};

/// Defaults for plans of one site. Letter case of site names is ignored.
struct PlanTemplate {
  std::string site;
  double width_mm = 300.0;   ///< Size of the region along x of the reference marker.
  double height_mm = 400.0;  ///< Along y.
  Tolerance tolerance;
  std::string changed_by;
};

/// Immutable once approved; a change of plan creates a new version.
struct Reference {
  std::string id;
  std::string patient_id;
  int version = 1;      ///< Increases within a patient.
  std::string scan_id;  ///< Its scene is DIR/scans/SCAN_ID/scene.
  WallClock::time_point created_at;
  std::string created_by;
  std::string reason;
  /// Counts the plans saved into this version; saving and approving state which one was read.
  int revision = 1;
  std::string digest;  ///< SHA-256 of the signed data: scan, version and plan.
  std::string planned_by;
  std::string approved_by;  ///< Empty for a draft; "auto" for the demo's.
  std::optional<WallClock::time_point> approved_at;
  ReferencePlan plan;
  std::string unreadable = {};  ///< Why the stored plan cannot be read; `plan` is then invalid.
};

/// One quantity of a daily check.
struct CheckItem {
  std::string name;             ///< markers_seen, misfit, moved, side, scale or depth_scale.
  std::optional<double> value;  ///< Not set if it could not be computed.
  double limit = 0.0;
  std::string unit;
  bool passed = false;
  std::string note;
};

/// A scan of the room's markers compared with the baseline.
struct CheckRecord {
  std::string id;
  WallClock::time_point time;
  std::string user;  ///< User who requested it.
  std::string sensor_serial;
  std::string status = "failed";  ///< "passed", "failed" or "no_baseline".
  std::vector<std::string> reasons;
  std::vector<CheckItem> items;
  std::size_t num_markers = 0;  ///< Markers that were seen well.
};

/// The check whose marker positions are the baseline.
struct CheckBaseline {
  std::string check_id;
  WallClock::time_point set_at;
  std::string set_by;
  std::size_t num_markers = 0;
};

struct CheckStatus {
  std::vector<CheckRecord> checks;  ///< Newest first.
  std::optional<CheckBaseline> baseline;
  DailyCheck today = DailyCheck::kOverdue;
};

/// The profile of a sensor unit from then on.
struct SensorProfileVersion {
  int version = 0;
  WallClock::time_point made_at;
  std::string cause;  ///< "learned", "rolled_back", "reset" or "unreadable".
  /// Number of sweeps from which it was learned; 0: the stated calibration is used.
  int num_sweeps = 0;
  std::map<std::string, double> values;  ///< As scene.json names them.
};

/// Profiles of the connected sensor unit.
struct SensorProfiles {
  std::string serial;
  std::string why_none;                        ///< Why no profile is kept; empty if one is.
  std::vector<SensorProfileVersion> versions;  ///< Newest first; the first one is in use.
};

/// Directions of the room on maps (x, y of a reference marker's frame): to the gantry, and to the
/// right of a person facing it.
struct RoomOnMap {
  std::array<double, 2> gantry_xy = {0, 1}, right_xy = {1, 0};
  bool is_known = false;  ///< False: the marker's axes are shown in place of the room's.
};

struct Status {
  ApplianceState state = ApplianceState::kNoSensor;
  std::string fault;  ///< In words, in state kFault.
  FaultKind fault_kind = FaultKind::kNone;
  SensorStatus sensor;
  StorageStatus storage;
  std::string light;       ///< Name of the shown pattern: "ready", "too_fast".
  std::string patient_id;  ///< Patient of the next scan; empty if there is none.
  ScanPurpose next_purpose = ScanPurpose::kFraction;
  int scans_today = 0;                      ///< Of the open patient; counts rescans.
  std::optional<TreatmentSession> session;  ///< The open session.
  RoomOnMap room;  ///< In the reference marker's frame as it lay when the room was calibrated.
  /// References that wait for a plan or an approval; at most 20.
  std::vector<WaitingReference> waiting;
  std::optional<LiveScan> scan;  ///< Set in states scanning and working.
  std::optional<CheckRecord> last_check;
  DailyCheck daily_check = DailyCheck::kOverdue;  ///< Of today.
  /// Why no reference may be scanned or approved now, with the next step; empty if it may.
  std::string reference_block = {};
  std::optional<Scan> last_result;  ///< The newest finished scan since the start.
  std::string version;
  std::vector<std::string> warnings;  ///< About the set-up of the appliance.
  std::string rolled_back;            ///< As in UpdateStatus.
};

/// What a person chose of the page; empty: the browser's language, the default theme.
struct Preferences {
  std::string language;  ///< "en" or "es".
  std::string theme;     ///< "dark", "light" or "auto".
};

struct User {
  std::string name;
  Role role = Role::kTechnician;
  std::string
      password_hash;  ///< libsodium's argon2id string; leaves the service only for the login.
  bool disabled = false;
  WallClock::time_point created_at;
};

/// Changes of an account; fields that are not set stay unchanged.
struct UserChange {
  std::string name;
  std::optional<Role> role;
  std::optional<bool> disabled;
  std::optional<std::string> password_hash;
  /// If set, the change requires that the account is enabled and still has this hash. For users who
  /// change their own password.
  std::optional<std::string> expected_hash;
};

/// What people know of an entry's subject, as the records are now.
struct AuditSubject {
  std::string kind;          ///< "patient", "session", "scan", "reference" or "check".
  bool exists = false;       ///< False: it was deleted since.
  std::string patient_code;  ///< Empty: none.
  int number = 0;            ///< Of a session its fraction, of a reference its version; 0: none.
  std::optional<WallClock::time_point> time = {};  ///< Of a check.
};

struct AuditEntry {
  std::int64_t number = 0;  ///< Assigned by the store; increases.
  WallClock::time_point time;
  std::string user;
  std::string address;
  std::string action;   ///< "login", "reference.approve".
  std::string subject;  ///< Id of the changed object.
  std::string detail;
  std::optional<AuditSubject> about = {};  ///< Of the subject; nothing: its id is what people know.
};

/// Within the limits of limits.hpp.
struct Settings {
  Tolerance tolerance;          ///< For new references.
  std::string posture = "HFS";  ///< For new references.
  bool couch_markers = false;   ///< For new references.
  double auto_stop_s = 10.0;    ///< Time without new coverage.
  double scan_limit_s = 60.0;
  bool keep_recordings = false;  ///< Keep the raw frames of scans, with colour.
  int retention_days = 0;        ///< Older scans are removed; 0: never. References are kept.
  int idle_logout_min = 15;
};

struct UpdateStatus {
  bool supported = false;  ///< False: not an appliance image.
  std::string message;     ///< Why not, or the present activity.
  std::string slot;
  bool installing = false;
  double fraction = 0.0;
  std::vector<std::string> bundles;  ///< Names of bundles on attached media.
  bool restart_needed = false;       ///< An update is installed and starts at the next restart.
  std::string failure;      ///< Why the last attempt was refused or failed; empty if it succeeded.
  std::string rolled_back;  ///< A sentence if the machine has gone back to the previous system.
};

struct Health {
  bool ok = true;
  std::string reason;
};

}  // namespace plumb::web
