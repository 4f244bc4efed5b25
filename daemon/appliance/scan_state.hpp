// SPDX-License-Identifier: Apache-2.0
// The state machine of the appliance: a pure function of the present state and an event.
#pragma once

#include <vector>

#include "algo/base/message.hpp"
#include "web/model/status.hpp"

namespace plumb {

struct ScanState {
  ApplianceState phase = ApplianceState::kNoSensor;
  bool has_sensor = false;  ///< Attached, open and streaming.
  bool sensor_fails =
      false;  ///< Attached but not working, whatever else is wrong; never together with has_sensor.
  /// Not kNone only in phase kFault, or in a scan that is being cancelled because of it.
  FaultKind fault = FaultKind::kNone;
  /// The running scan was requested to stop and has not stopped yet; kScanning and kWorking only.
  bool cancelling = false;
  bool operator==(const ScanState&) const = default;
};

enum class ScanEvent {
  kSensorReady,   ///< Frames arrive.
  kSensorLost,    ///< Unplugged.
  kSensorFailed,  ///< Attached, but cannot be opened, reports an error or delivers nothing.
  kShortPress,    ///< The button or its equivalent: starts a scan, ends a sweep, acknowledges.
  kLongPress,     ///< Discards the running scan, or dismisses a result.
  kStart,         ///< The page's buttons, each for one purpose only.
  kEndSweep,
  kCancel,
  kSweepComplete,  ///< No new coverage for long enough, or the longest sweep is over.
  kScanDone,       ///< There is a result, possibly without an answer.
  kScanFailed,
  kScanCancelled,  ///< The threads of the cancelled scan have ended.
  kResultExpired,  ///< Old enough to be dismissed.
  kStorageFailed,
  kStorageWorks,  ///< Again, after it had failed.
  kMonitorStart,
  kMonitorStop,
  kMonitorEnded,  ///< It cannot go on.
};

enum class ScanAction {
  kStartScan,
  kEndSweep,
  kCancelScan,
  kArmResultTimer,
  kStartMonitor,
  kEndMonitor,
  kRefuse
};

struct ScanTransition {
  ScanState state;
  std::vector<ScanAction> actions;
  Message refusal;  ///< With kRefuse: why, and what to do.
};

/// Total: every event is defined in every state. Invalid events change nothing.
[[nodiscard]] ScanTransition Next(const ScanState& state, ScanEvent event);

[[nodiscard]] const char* Name(ScanEvent event);

}  // namespace plumb
