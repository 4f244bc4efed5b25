// What the page shows and changes, as plain values. Codes of patients are pseudonyms; no field
// holds a name of a person who was scanned.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace plumb::web {

using WallClock = std::chrono::system_clock;

enum class ApplianceState { kNoSensor, kReady, kScanning, kWorking, kResult, kFault };
enum class FaultKind { kNone, kSensor, kScan, kStorage };
enum class Guidance {
  kNone,
  kSlower,
  kCloser,
  kFarther,
  kTrackingLost,
  kNoMarkers,
  kComputerTooSlow,  ///< Images are lost because they cannot be followed in time.
};
enum class ScanPurpose { kFraction, kReference, kDailyCheck };
enum class ScanOutcome { kRunning, kDone, kCancelled, kFailed };
/// kDisplay: a paired screen in the room, which sees and changes nothing.
enum class Role { kTechnician, kPhysicist, kEngineer, kDisplay };

/// A result is shown as one to act on, and can be accepted, for so long.
inline constexpr double kResultValid_s = 120.0;

/// Who asks for a change; goes into the audit log with it.
struct Actor {
  std::string user;     ///< Name of the account.
  std::string address;  ///< Of the browser.
};

struct SensorStatus {
  bool present = false;
  std::string serial;
  std::string name;
  double frames_per_second = 0.0;
  double powered_s = 0.0;  ///< Since it was attached; warm-up.
};

/// The scan that runs or is being worked on.
struct LiveScan {
  std::string id;
  std::string patient_id;
  ScanPurpose purpose = ScanPurpose::kFraction;
  double elapsed_s = 0.0;
  std::optional<double> coverage;  ///< 0..1 of the region of the reference (else of what was seen
                                   ///< lately); unknown: nothing.
  double without_new_surface_s = 0.0;  ///< Since surface was last seen for the first time.
  Guidance guidance = Guidance::kNone;
  std::int64_t keyframes = 0;
  std::int64_t frames = 0;
  std::int64_t frames_tracked = 0;
  std::int64_t frames_dropped = 0;
  std::string step;            ///< "tracking", then what the reconstructor names.
  double step_fraction = 0.0;  ///< 0..1
};

struct StorageStatus {
  std::int64_t free_bytes = 0;
  std::int64_t total_bytes = 0;
  bool writable = true;
  std::vector<std::string> warnings = {};  ///< Sentences for people: nearly full, no backup.
};

struct SixNumbers {
  std::optional<double> vertical_mm;  ///< Shifts: nothing with couch-fixed markers.
  std::optional<double> longitudinal_mm;
  std::optional<double> lateral_mm;
  double pitch_deg = 0.0;
  double roll_deg = 0.0;
  double yaw_deg = 0.0;
};

struct Tolerance {
  double shift_mm = 3.0;
  double rotation_deg = 1.0;
};

/// What a comparison answered, short enough for a list. All else is in result.json.
struct ResultSummary {
  std::string verdict;  ///< "in_tolerance", "unsure", "move" or "no_answer".
  std::vector<std::string> reasons;
  std::optional<SixNumbers> correction;  ///< What to APPLY. With "no_answer" it is there for who
                                         ///< studies it, never to be shown as advice.
  std::optional<SixNumbers> u95;
  std::array<std::string, 6> words;  ///< Of the correction: vertical, longitudinal, lateral, pitch,
                                     ///< roll, yaw; empty where not known.
  std::vector<std::string> body_now;    ///< "left shoulder 9 mm high", before any correction.
  std::vector<std::string> body_after;  ///< The same once the correction is applied: the posture.
};

struct Scan {
  std::string id;
  std::string patient_id;
  std::string reference_id;  ///< Compared with; empty: none.
  ScanPurpose purpose = ScanPurpose::kFraction;
  ScanOutcome outcome = ScanOutcome::kRunning;
  std::string failure;  ///< Why, where it failed or was cancelled.
  WallClock::time_point started_at;
  std::optional<WallClock::time_point> finished_at;
  std::optional<ResultSummary> result;
  std::string accepted_by;      ///< Empty: not accepted.
  std::string accepted_reason;  ///< Why, where it was accepted outside tolerance.
  std::optional<WallClock::time_point> accepted_at;
  std::string session_id;             ///< Treatment session in which it was made; empty: none.
  int fraction = 0;                   ///< Number of that session's fraction; 0: none.
  std::optional<double> sensor_on_s;  ///< Of the sensor when the scan began; warm-up.
  bool check_overdue = false;         ///< No daily check had passed when the scan began.
  std::optional<double> age_s =
      {};  ///< Since its end, by a clock that does not step; nothing: only the wall clock can tell.
  std::filesystem::path
      folder;  ///< DIR/scans/ID; holds scene/, result/ and recording/, each where it exists.
};

struct Patient {
  std::string id;    ///< Of the store, never shown.
  std::string code;  ///< The pseudonym that people type and read.
  std::string site;  ///< Region of the body: "thorax".
  WallClock::time_point created_at;
  std::string
      approved_reference_id;  ///< The one that fractions are compared with; empty: none yet.
  std::int64_t num_scans = 0;
  std::string draft_reference_id;  ///< The newest draft after the approved one; empty: none waits.
  std::string note = {};  ///< What people wrote of this course, at most kMaxNote bytes; no name.
  bool archived = false;  ///< Out of the list and not to be opened; nothing is deleted.
};

inline constexpr std::size_t kMaxSite = 64, kMaxNote = 500;  // bytes

/// A patient on the couch, from opening to closing. One at a time.
struct TreatmentSession {
  std::string id;
  std::string patient_id;
  std::string patient_code;
  ScanPurpose purpose = ScanPurpose::kFraction;
  int fraction = 0;   ///< 1, 2, ... in sessions of fractions, else 0.
  int num_scans = 0;  ///< Done in this session.
  std::string opened_by;
  WallClock::time_point opened_at;
};

/// A draft that somebody has to plan or approve.
struct WaitingReference {
  std::string reference_id;
  std::string patient_id;
  std::string patient_code;
  int version = 1;
};

/// A screen in the room that was paired: it sees, and changes nothing.
struct Display {
  std::string id;
  std::string name;
  std::string token_hash;  ///< Hexadecimal; never leaves the service but to the login.
  WallClock::time_point paired_at;
  std::string paired_by;
};

/// What the physicist sets before a reference is approved.
struct ReferencePlan {
  std::vector<std::array<double, 2>>
      region_m;  ///< Polygon, reference marker's frame; empty: the segmented body.
  std::optional<std::array<double, 3>>
      isocentre_m;  ///< Reference marker's frame; nothing: centroid of the region.
  Tolerance tolerance;
  std::string posture = "HFS";  ///< HFS, HFP, FFS, FFP.
  bool couch_markers = false;   ///< Markers move with the couch: shifts are refused.
};

/// What plans of one site begin with. Sites are the same whatever the case of their letters.
struct PlanTemplate {
  std::string site;
  double width_mm = 300.0;   ///< Of the region along x of the reference marker.
  double height_mm = 400.0;  ///< Along y.
  Tolerance tolerance;
  std::string changed_by;
};

/// Immutable once approved; a change of plan makes a new version.
struct Reference {
  std::string id;
  std::string patient_id;
  int version = 1;      ///< Counts up within a patient.
  std::string scan_id;  ///< Its scene is DIR/scans/SCAN_ID/scene.
  WallClock::time_point created_at;
  std::string created_by;
  std::string reason;
  int revision = 1;  ///< Counts the plans that were saved into this version: who saves or approves
                     ///< says which one was read.
  std::string digest;  ///< SHA-256 of what is signed: scan, version and plan.
  std::string planned_by;
  std::string approved_by;  ///< Empty: a draft. "auto": the demo's.
  std::optional<WallClock::time_point> approved_at;
  ReferencePlan plan;
  std::string unreadable = {};  ///< Why the stored plan cannot be read: `plan` then says nothing.
};

/// One number of a daily check.
struct CheckItem {
  std::string name;             ///< markers_seen, misfit, moved, side, scale, depth_scale
  std::optional<double> value;  ///< Nothing: could not be computed.
  double limit = 0.0;
  std::string unit;
  bool passed = false;
  std::string note;
};

/// A scan of the room's markers against where they lay.
struct CheckRecord {
  std::string id;
  WallClock::time_point time;
  std::string user;  ///< Who asked for it.
  std::string sensor_serial;
  std::string status = "failed";  ///< "passed", "failed" or "no_baseline".
  std::vector<std::string> reasons;
  std::vector<CheckItem> items;
  std::size_t num_markers = 0;  ///< Seen well.
};

/// The check whose markers count as lying right.
struct CheckBaseline {
  std::string check_id;
  WallClock::time_point set_at;
  std::string set_by;
  std::size_t num_markers = 0;
};

struct CheckStatus {
  std::vector<CheckRecord> checks;  ///< Newest first.
  std::optional<CheckBaseline> baseline;
  bool overdue = true;  ///< None passed today.
};

/// What was known of a sensor unit from then on.
struct SensorProfileVersion {
  int version = 0;
  WallClock::time_point made_at;
  std::string cause;   ///< "learned", "rolled_back", "reset" or "unreadable".
  int num_sweeps = 0;  ///< That it was learned from; 0: from here on nothing was known.
  std::map<std::string, double> values;  ///< As scene.json names them.
};

/// Of the connected sensor unit.
struct SensorProfiles {
  std::string serial;
  std::string why_none;                        ///< Why no profile is kept; empty: one is.
  std::vector<SensorProfileVersion> versions;  ///< Newest first; the first one is in use.
};

struct Status {
  ApplianceState state = ApplianceState::kNoSensor;
  std::string fault;  ///< In words, in state kFault.
  FaultKind fault_kind = FaultKind::kNone;
  SensorStatus sensor;
  StorageStatus storage;
  std::string light;       ///< Name of the pattern shown: "ready", "too_fast".
  std::string patient_id;  ///< Open for the next scan; empty: none.
  ScanPurpose next_purpose = ScanPurpose::kFraction;
  int scans_today = 0;                      ///< Of the open patient: the rescan counter.
  std::optional<TreatmentSession> session;  ///< Open now.
  /// Directions of the room on maps (x, y of the reference marker's frame): to the gantry, and to
  /// the right of a person who faces it.
  std::array<double, 2> gantry_xy = {0, 1}, right_xy = {1, 0};
  bool is_room_known = false;             ///< False: as if the marker's axes were the room's.
  std::vector<WaitingReference> waiting;  ///< For a plan or an approval; at most 20.
  std::optional<LiveScan> scan;           ///< In states scanning and working.
  std::optional<CheckRecord> last_check;
  bool check_overdue = true;  ///< No daily check passed today.
  /// Why no reference may be scanned or approved now, with the next step; empty: it may.
  std::string reference_block = {};
  std::optional<Scan> last_result;  ///< The newest finished scan of this run.
  std::string version;
  std::vector<std::string> warnings;  ///< Of how the appliance is set up.
  std::string rolled_back;            ///< As in UpdateStatus.
};

struct User {
  std::string name;
  Role role = Role::kTechnician;
  std::string
      password_hash;  ///< libsodium's argon2id string; never leaves the service but to the login.
  bool disabled = false;
  WallClock::time_point created_at;
};

/// What of an account is to be changed; the rest stays.
struct UserChange {
  std::string name;
  std::optional<Role> role;
  std::optional<bool> disabled;
  std::optional<std::string> password_hash;
  /// Set: only if the account is enabled and still has this hash. For people who change their own.
  std::optional<std::string> expected_hash;
};

struct AuditEntry {
  std::int64_t number = 0;  ///< Given by the store; counts up.
  WallClock::time_point time;
  std::string user;
  std::string address;
  std::string action;   ///< "login", "reference.approve".
  std::string subject;  ///< Id of what was changed.
  std::string detail;
};

struct Settings {
  Tolerance tolerance;           ///< Of new references.
  std::string posture = "HFS";   ///< Of new references.
  bool couch_markers = false;    ///< Of new references.
  double auto_stop_s = 10.0;     ///< Without new coverage; 1..120.
  double scan_limit_s = 60.0;    ///< 5..600.
  bool keep_recordings = false;  ///< Raw frames of scans are kept, with colour.
  int retention_days = 0;        ///< Scans older than that are removed; 0: never. References stay.
  int idle_logout_min = 15;      ///< 1..240.
};

struct UpdateStatus {
  bool supported = false;  ///< False: not an appliance image.
  std::string message;     ///< Why not, or what is going on.
  std::string slot;
  bool installing = false;
  double fraction = 0.0;
  std::vector<std::string> bundles;  ///< Names of bundles on attached media.
  bool restart_needed = false;       ///< One is installed and starts at the next restart.
  std::string failure;      ///< Why the last attempt was refused or failed; empty: it was not.
  std::string rolled_back;  ///< A sentence, where the machine has gone back to the previous system.
};

struct Health {
  bool ok = true;
  std::string reason;
};

}  // namespace plumb::web
