// What the appliance does next: a pure function of what it does now and what happened.
#pragma once

#include <string_view>
#include <vector>

namespace plumb {

/// As the contract names them; see Name().
enum class ScanPhase { kNoSensor, kReady, kScanning, kWorking, kResult, kFault };

/// What keeps the appliance from scanning, or will once the running scan has ended.
enum class FaultKind {
  kNone,
  kSensor,   ///< The sensor is attached and does not work; over as soon as it works or is gone.
  kScan,     ///< The last scan failed; over once somebody acknowledged it by a press.
  kStorage,  ///< Nothing can be stored: safe mode until the next start.
};

struct ScanState {
  ScanPhase phase = ScanPhase::kNoSensor;
  bool has_sensor = false;  ///< Attached, open and streaming.
  bool sensor_fails =
      false;  ///< Attached and does not work, whatever else is wrong; never with has_sensor.
  FaultKind fault = FaultKind::kNone;  ///< Not kNone in phase kFault only, or in a scan that is
                                       ///< being cancelled because of it.
  bool cancelling =
      false;  ///< The running scan was told to stop and has not yet; kScanning and kWorking only.
  bool operator==(const ScanState&) const = default;
};

enum class ScanEvent {
  kSensorReady,   ///< Frames arrive.
  kSensorLost,    ///< Unplugged.
  kSensorFailed,  ///< Attached, but cannot be opened, reports an error or delivers nothing.
  kShortPress,    ///< The button, or what stands for it: starts a scan, ends a sweep, acknowledges.
  kLongPress,     ///< Discards the running scan; puts a result away.
  kStart,         ///< The page's buttons, each for one purpose only.
  kEndSweep,
  kCancel,
  kSweepComplete,  ///< No new coverage for long enough, or the longest sweep is over.
  kScanDone,       ///< There is a result; it may say that there is no answer.
  kScanFailed,
  kScanCancelled,  ///< The cancelled scan's threads are through.
  kResultExpired,  ///< Old enough to be put away.
  kStorageFailed,
};

enum class ScanAction { kStartScan, kEndSweep, kCancelScan, kArmResultTimer, kRefuse };

struct ScanTransition {
  ScanState state;
  std::vector<ScanAction> actions;
  std::string_view refusal;  ///< With kRefuse: one sentence why, and what to do.
};

/// Total: every event is defined in every state. What makes no sense changes nothing.
[[nodiscard]] ScanTransition Next(const ScanState& state, ScanEvent event);

/// "no_sensor", "ready", "scanning", "working", "result", "fault"
[[nodiscard]] const char* Name(ScanPhase phase);
[[nodiscard]] const char* Name(ScanEvent event);

}  // namespace plumb
