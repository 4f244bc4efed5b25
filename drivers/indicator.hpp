// The light (and beeper) that shows the technician what the appliance is doing.
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
  kDone,  ///< A scan that was compared with nothing.
  kResultInTolerance,
  kResultUnsure,  ///< Every value within its tolerance, but not with its uncertainty.
  kResultMove,
  kNoAnswer,
  kFault,
  kReadyRolledBack,  ///< Ready, but the machine has gone back to the system from before an update.
  kStopped,          ///< Nobody scans: the service is not running.
};

/// A light. One thread (the event loop's) calls; no call blocks or throws: a broken light must not
/// stop a scan.
class Indicator {
 public:
  virtual ~Indicator() = default;
  virtual void Show(IndicatorPattern pattern) noexcept = 0;
};

}  // namespace plumb
