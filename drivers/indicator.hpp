// SPDX-License-Identifier: Apache-2.0
// The light (and beeper) that shows the technician the appliance's state.
#pragma once

namespace plumb {

enum class IndicatorPattern {
  kOff,
  kNoSensor,
  kReady,
  kScanning,
  kTooFast,
  kTooNear,
  kTooFar,
  kWorking,
  kDone,  ///< A scan without comparison.
  kResultInTolerance,
  kResultUnsure,  ///< Every value is within its tolerance, but not with its uncertainty.
  kResultMove,
  kNoAnswer,
  kFault,
  kReadyRolledBack,      ///< Ready, but the system before the last update was restored.
  kReadyDiskNearlyFull,  ///< Ready, but there is little room for more scans.
  kReadyGuessed,         ///< Ready, but somebody is guessing passwords of the page.
  kReadyToMonitor,       ///< The sensor is at rest: a press starts monitoring, not a sweep.
  kMonitorStarting,      ///< Mounting, zeroing.
  kMonitorIn,
  kMonitorOut,
  kMonitorUnknown,  ///< Counts as hold.
  kStopped,         ///< The service is not running, and no scan is possible.
};

/// A light. Called on the event loop's thread only. No call blocks or throws: a broken light must
/// not stop a scan.
class Indicator {
 public:
  virtual ~Indicator() = default;
  virtual void Show(IndicatorPattern pattern) noexcept = 0;
};

}  // namespace plumb
