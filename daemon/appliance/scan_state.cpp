#include "daemon/appliance/scan_state.hpp"

namespace plumb {

namespace {

ScanTransition Stay(const ScanState& state) {
  return {.state = state, .actions = {}, .refusal = {}};
}

ScanTransition Refuse(const ScanState& state, std::string_view why) {
  return {.state = state, .actions = {ScanAction::kRefuse}, .refusal = why};
}

/// The fault while no scan has failed and storage works.
FaultKind SensorFault(const ScanState& state) {
  return state.sensor_fails ? FaultKind::kSensor : FaultKind::kNone;
}

std::string_view WhyNoSensor(const ScanState& state) {
  return state.sensor_fails ? "the sensor does not work: see the reason in the status; unplug it "
                              "and plug it in again"
                            : "no sensor is attached: plug it in and wait for the ready light";
}

/// Resting state when no scan runs and no result is shown.
ScanTransition Settle(ScanState state) {
  state.cancelling = false;
  if (state.fault != FaultKind::kNone) {
    state.phase = ApplianceState::kFault;
  } else {
    state.phase = state.has_sensor ? ApplianceState::kReady : ApplianceState::kNoSensor;
  }
  return Stay(state);
}

ScanTransition Start(ScanState state) {
  state.phase = ApplianceState::kScanning;
  return {.state = state, .actions = {ScanAction::kStartScan}, .refusal = {}};
}

/// Requests a running scan to stop, once. The state changes when it has stopped.
ScanTransition Cancel(ScanState state) {
  if (state.cancelling) return Stay(state);
  state.cancelling = true;
  return {.state = state, .actions = {ScanAction::kCancelScan}, .refusal = {}};
}

ScanTransition Fail(ScanState state, FaultKind fault) {
  if (state.fault != FaultKind::kStorage) state.fault = fault;
  return Settle(state);
}

/// Reports of the sensor and the store are recorded in any phase; their consequences depend on the
/// phase.
void Note(ScanState& state, ScanEvent event) {
  if (event == ScanEvent::kSensorReady || event == ScanEvent::kSensorLost ||
      event == ScanEvent::kSensorFailed) {
    state.has_sensor = event == ScanEvent::kSensorReady;
    state.sensor_fails = event == ScanEvent::kSensorFailed;
    if (state.fault == FaultKind::kNone || state.fault == FaultKind::kSensor)
      state.fault = SensorFault(state);
  }
  if (event == ScanEvent::kStorageFailed) state.fault = FaultKind::kStorage;
  if (event == ScanEvent::kStorageWorks && state.fault == FaultKind::kStorage)
    state.fault = SensorFault(state);
}

ScanTransition InNoSensor(const ScanState& state, ScanEvent event) {
  switch (event) {
    case ScanEvent::kShortPress:
    case ScanEvent::kLongPress:
    case ScanEvent::kStart:
      return Refuse(state, WhyNoSensor(state));
    case ScanEvent::kEndSweep:
    case ScanEvent::kCancel:
      return Refuse(state, "no scan is running");
    default:
      return Settle(state);
  }
}

ScanTransition InReady(const ScanState& state, ScanEvent event) {
  switch (event) {
    case ScanEvent::kShortPress:
    case ScanEvent::kStart:
      return Start(state);
    case ScanEvent::kLongPress:
    case ScanEvent::kEndSweep:
    case ScanEvent::kCancel:
      return Refuse(state, "no scan is running: press shortly to start one");
    default:
      return Settle(state);
  }
}

ScanTransition InScanning(ScanState state, ScanEvent event) {
  const bool is_command = event == ScanEvent::kShortPress || event == ScanEvent::kLongPress ||
                          event == ScanEvent::kStart || event == ScanEvent::kEndSweep ||
                          event == ScanEvent::kCancel;
  if (is_command && state.cancelling)
    return Refuse(state, "the scan is being discarded: wait a moment");
  switch (event) {
    case ScanEvent::kShortPress:
    case ScanEvent::kEndSweep:
    case ScanEvent::kSweepComplete:
      if (state.cancelling) return Stay(state);
      state.phase = ApplianceState::kWorking;
      return {.state = state, .actions = {ScanAction::kEndSweep}, .refusal = {}};
    case ScanEvent::kStart:
      return Refuse(state, "a scan is running already: end or cancel it first");
    case ScanEvent::kLongPress:
    case ScanEvent::kCancel:
    // a partial scan is discarded and never mixed with frames of a re-plugged sensor
    case ScanEvent::kSensorLost:
    case ScanEvent::kSensorFailed:
    case ScanEvent::kStorageFailed:
      return Cancel(state);
    default:
      return Stay(state);
  }
}

ScanTransition InWorking(const ScanState& state, ScanEvent event) {
  switch (event) {
    case ScanEvent::kShortPress:
    case ScanEvent::kStart:
    case ScanEvent::kEndSweep:
      return Refuse(state, "the last scan is being worked on: wait for its result");
    case ScanEvent::kLongPress:
    case ScanEvent::kCancel:
      if (state.cancelling) return Refuse(state, "the scan is being discarded: wait a moment");
      return Cancel(state);
    case ScanEvent::kStorageFailed:
      return Cancel(state);
    default:
      return Stay(state);  // all frames have arrived: losing the sensor now does no harm
  }
}

/// Events that end a scan, in either of its phases.
ScanTransition AfterScan(ScanState state, ScanEvent event) {
  state.cancelling = false;
  if (event == ScanEvent::kScanCancelled) return Settle(state);
  if (event == ScanEvent::kScanFailed) return Fail(state, FaultKind::kScan);
  if (state.fault == FaultKind::kStorage) return Settle(state);
  state.phase = ApplianceState::kResult;
  return {.state = state, .actions = {ScanAction::kArmResultTimer}, .refusal = {}};
}

ScanTransition InResult(const ScanState& state, ScanEvent event) {
  switch (event) {
    case ScanEvent::kShortPress:
    case ScanEvent::kStart:
      if (state.has_sensor && state.fault == FaultKind::kNone) return Start(state);
      return Refuse(Settle(state).state, WhyNoSensor(state));
    case ScanEvent::kEndSweep:
    case ScanEvent::kCancel:
      return Refuse(state, "no scan is running");
    case ScanEvent::kLongPress:
    case ScanEvent::kResultExpired:
    case ScanEvent::kSensorLost:
    case ScanEvent::kSensorFailed:
    case ScanEvent::kStorageFailed:
      return Settle(state);
    default:
      return Stay(state);
  }
}

ScanTransition InFault(ScanState state, ScanEvent event) {
  const bool is_press = event == ScanEvent::kShortPress || event == ScanEvent::kLongPress;
  const bool is_command = is_press || event == ScanEvent::kStart || event == ScanEvent::kEndSweep ||
                          event == ScanEvent::kCancel;
  if (!is_command) return Settle(state);
  if (state.fault == FaultKind::kScan && is_press) {
    state.fault = SensorFault(state);  // it may have failed meanwhile, and reports so only once
    return Settle(state);
  }
  if (state.fault == FaultKind::kStorage)
    return Refuse(state,
                  "the storage has failed: see the reason in the status; nothing can be scanned");
  if (state.fault == FaultKind::kScan)
    return Refuse(state, "the last scan failed: press the button to acknowledge it");
  return Refuse(state, WhyNoSensor(state));
}

}  // namespace

ScanTransition Next(const ScanState& before, ScanEvent event) {
  ScanState state = before;
  Note(state, event);
  const bool is_running =
      state.phase == ApplianceState::kScanning || state.phase == ApplianceState::kWorking;
  const bool ends_scan = event == ScanEvent::kScanDone || event == ScanEvent::kScanFailed ||
                         event == ScanEvent::kScanCancelled;
  if (ends_scan) return is_running ? AfterScan(state, event) : Stay(state);
  switch (state.phase) {
    case ApplianceState::kNoSensor:
      return InNoSensor(state, event);
    case ApplianceState::kReady:
      return InReady(state, event);
    case ApplianceState::kScanning:
      return InScanning(state, event);
    case ApplianceState::kWorking:
      return InWorking(state, event);
    case ApplianceState::kResult:
      return InResult(state, event);
    case ApplianceState::kFault:
      return InFault(state, event);
  }
  return Stay(state);
}

const char* Name(ScanEvent event) {
  static constexpr auto kNames = NamesUpTo<ScanEvent::kStorageWorks>(
      {"sensor_ready", "sensor_lost", "sensor_failed", "short_press", "long_press", "start",
       "end_sweep", "cancel", "sweep_complete", "scan_done", "scan_failed", "scan_cancelled",
       "result_expired", "storage_failed", "storage_works"});
  return kNames.at(static_cast<std::size_t>(event)).data();
}

}  // namespace plumb
