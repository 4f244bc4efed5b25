// SPDX-License-Identifier: Apache-2.0
// The state of the appliance.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/base/names.hpp"
#include "web/model/check.hpp"
#include "web/model/couch.hpp"
#include "web/model/forming_answer.hpp"
#include "web/model/patient.hpp"
#include "web/model/reference.hpp"
#include "web/model/scan.hpp"

namespace plumb {

// The names of the values are in names.hpp.
enum class ApplianceState { kNoSensor, kReady, kScanning, kWorking, kResult, kMonitoring, kFault };
template <>
inline constexpr auto kNamesOf<ApplianceState> = NamesUpTo<ApplianceState::kFault>(
    {"no_sensor", "ready", "scanning", "working", "result", "monitoring", "fault"});

/// The reason why the appliance cannot scan, or will not be able to once the running scan has
/// ended.
enum class FaultKind {
  kNone,
  kSensor,   ///< The sensor is attached and does not work; ends when it works or is unplugged.
  kScan,     ///< The last scan failed; ends when somebody acknowledges it by a press.
  kStorage,  ///< Nothing can be stored; ends when the storage works again.
};
template <>
inline constexpr auto kNamesOf<FaultKind> = NamesUpTo<FaultKind::kStorage>({"none", "sensor",
                                                                            "scan", "storage"});

/// Advice to the person who sweeps.
enum class SweepAdvice {
  kNone,
  kSlower,
  kCloser,
  kFarther,
  kTrackingLost,
  kNoMarkers,
  kComputerTooSlow,  ///< Images are lost because they cannot be processed in time.
  kEnough,           ///< Going on changes neither the verdict nor, by much, the numbers.
};
template <>
inline constexpr auto kNamesOf<SweepAdvice> =
    NamesUpTo<SweepAdvice::kEnough>({"none", "slower", "closer", "farther", "tracking_lost",
                                     "no_markers", "computer_too_slow", "enough"});

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
  Message step;                ///< "tracking", then the steps of the reconstructor.
  double step_fraction = 0.0;  ///< 0..1
  std::optional<FormingAnswer> forming = {};
};

/// What was done since the start, for systems that watch the unit.
struct ScanCounts {
  std::int64_t failed = 0, cancelled = 0;
  std::array<std::int64_t, kNamesOf<Verdict>.size()> verdicts = {};  ///< By Verdict.
  std::int64_t without_comparison = 0;                               ///< References, daily checks.
  std::int64_t frames = 0, frames_dropped = 0;
  std::optional<double> answer_s = {};  ///< Of the newest scan, from its last frame.
};

struct StorageStatus {
  std::int64_t free_bytes = 0;
  std::int64_t total_bytes = 0;
  bool writable = true;
  std::vector<Message> warnings = {};  ///< Nearly full, no backup.
  /// Not set: there is no backup of the last days in the configured folder.
  std::optional<WallClock::time_point> backup_made_at = {};
};

/// Directions of the room on maps (x, y of a reference marker's frame): to the gantry, and to the
/// right of a person facing it.
struct RoomOnMap {
  std::array<double, 2> gantry_xy = {0, 1}, right_xy = {1, 0};
  bool is_known = false;  ///< False: the marker's axes are shown in place of the room's.
  /// Where the lasers cross, in the frame of the map; only of a reference in a calibrated room.
  std::optional<std::array<double, 3>> lasers_m = {};
  /// The surface of a draft speaks against its planned posture: the body lies across, or its head
  /// is where the feet should be. An approval has to confirm the posture then.
  bool contradicts_posture = false;
};

/// One way of sending messages out (mail, syslog or webhook) and its state.
struct MessageWay {
  std::string name;                   ///< mail, syslog or webhook.
  std::int64_t sent = 0, failed = 0;  ///< Since the start; failed: given up.
  std::int64_t waiting = 0;
  Message failure = {};  ///< Of the newest attempt; empty if that one was taken.
  std::optional<WallClock::time_point> sent_at = {};
};

struct Status {
  ApplianceState state = ApplianceState::kNoSensor;
  Message fault;  ///< In state kFault.
  FaultKind fault_kind = FaultKind::kNone;
  SensorStatus sensor;
  StorageStatus storage;
  std::string light;  ///< Name of the shown pattern: "ready", "too_fast".
  /// The sensor is at rest: the next press starts monitoring instead of a sweep.
  bool press_monitors = false;
  /// No sweep of the open session begins before the wristband of its patient has been scanned.
  bool wants_wristband = false;
  std::string patient_id;  ///< Patient of the next scan; empty if there is none.
  ScanPurpose next_purpose = ScanPurpose::kFraction;
  int scans_today = 0;                      ///< Scans of the open patient, rescans included.
  std::optional<TreatmentSession> session;  ///< The open session.
  CouchProfile couch;
  RoomOnMap room;  ///< In the reference marker's frame as it lay when the room was calibrated.
  /// References that wait for a plan or an approval; at most 20.
  std::vector<WaitingReference> waiting;
  std::optional<LiveScan> scan;  ///< Set in states scanning and working.
  std::optional<CheckRecord> last_check;
  DailyCheck daily_check = DailyCheck::kOverdue;  ///< Today's check.
  /// Why no reference may be scanned or approved now, with the next step; empty if it may.
  Message reference_block = {};
  std::optional<Scan> last_result;  ///< The newest finished scan since the start.
  std::string version;
  std::vector<Message> warnings;  ///< About the set-up of the appliance.
  Message rolled_back;            ///< The same as in UpdateStatus.
  ScanCounts counts;
  std::vector<MessageWay> messages;
  /// In which other units the open patient is open, too, and of which that is not known.
  std::vector<Message> peer_notes = {};
};

struct UpdateStatus {
  bool supported = false;  ///< False: not an appliance image.
  Message message;         ///< Why not, or the present activity.
  std::string slot;
  bool installing = false;
  double fraction = 0.0;
  std::vector<std::string> bundles;  ///< Names of bundles on attached media.
  bool restart_needed = false;       ///< An update is installed and starts at the next restart.
  Message failure;       ///< Why the last attempt was refused or failed; empty if it succeeded.
  Message rolled_back;   ///< A sentence if the machine has gone back to the previous system.
  Message offered = {};  ///< A bundle that came from the channel; empty: there is none.
  Message channel_failure = {};  ///< Why the newest look at the channel failed.
};

struct Health {
  bool ok = true;
  Message reason;
};

}  // namespace plumb
