// SPDX-License-Identifier: Apache-2.0
#include "daemon/appliance/scan_state.hpp"

#include <utility>

#include "words/monitoring.hpp"
#include "words/scan.hpp"

namespace plumb {

namespace {

ScanTransition Stay(const ScanState& state) {
  return {.state = state, .actions = {}, .refusal = {}};
}

ScanTransition Refuse(const ScanState& state, Message why) {
  return {.state = state, .actions = {ScanAction::kRefuse}, .refusal = std::move(why)};
}

/// The fault while no scan has failed and storage works.
FaultKind SensorFault(const ScanState& state) {
  return state.sensor_fails ? FaultKind::kSensor : FaultKind::kNone;
}

Message WhyNoSensor(const ScanState& state) {
  return state.sensor_fails ? say::scan::SensorFails() : say::scan::PlugSensorIn();
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

ScanTransition Monitor(ScanState state) {
  state.phase = ApplianceState::kMonitoring;
  return {.state = state, .actions = {ScanAction::kStartMonitor}, .refusal = {}};
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
    case ScanEvent::kMonitorStart:
      return Refuse(state, WhyNoSensor(state));
    case ScanEvent::kMonitorStop:
      return Refuse(state, say::monitoring::NotRunning());
    case ScanEvent::kEndSweep:
    case ScanEvent::kCancel:
      return Refuse(state, say::scan::NotRunning());
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
      return Refuse(state, say::scan::PressToStart());
    case ScanEvent::kMonitorStart:
      return Monitor(state);
    case ScanEvent::kMonitorStop:
      return Refuse(state, say::monitoring::NotRunning());
    default:
      return Settle(state);
  }
}

ScanTransition InScanning(ScanState state, ScanEvent event) {
  const bool is_command = event == ScanEvent::kShortPress || event == ScanEvent::kLongPress ||
                          event == ScanEvent::kStart || event == ScanEvent::kEndSweep ||
                          event == ScanEvent::kCancel;
  if (is_command && state.cancelling) return Refuse(state, say::scan::BeingDiscarded());
  if (event == ScanEvent::kMonitorStart) return Refuse(state, say::monitoring::ScanRuns());
  if (event == ScanEvent::kMonitorStop) return Refuse(state, say::monitoring::NotRunning());
  switch (event) {
    case ScanEvent::kShortPress:
    case ScanEvent::kEndSweep:
    case ScanEvent::kSweepComplete:
      if (state.cancelling) return Stay(state);
      state.phase = ApplianceState::kWorking;
      return {.state = state, .actions = {ScanAction::kEndSweep}, .refusal = {}};
    case ScanEvent::kStart:
      return Refuse(state, say::scan::RunningAlready());
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
      return Refuse(state, say::scan::BeingComputed());
    case ScanEvent::kMonitorStart:
      return Refuse(state, say::monitoring::ScanRuns());
    case ScanEvent::kMonitorStop:
      return Refuse(state, say::monitoring::NotRunning());
    case ScanEvent::kLongPress:
    case ScanEvent::kCancel:
      if (state.cancelling) return Refuse(state, say::scan::BeingDiscarded());
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
    case ScanEvent::kMonitorStart:
      if (state.has_sensor && state.fault == FaultKind::kNone) return Monitor(state);
      return Refuse(Settle(state).state, WhyNoSensor(state));
    case ScanEvent::kMonitorStop:
      return Refuse(state, say::monitoring::NotRunning());
    case ScanEvent::kEndSweep:
    case ScanEvent::kCancel:
      return Refuse(state, say::scan::NotRunning());
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

ScanTransition InMonitoring(const ScanState& state, ScanEvent event) {
  switch (event) {
    case ScanEvent::kStart: {
      ScanTransition start = Start(state);
      start.actions.insert(start.actions.begin(), ScanAction::kEndMonitor);
      return start;
    }
    case ScanEvent::kMonitorStart:
      return Refuse(state, say::monitoring::RunsAlready());
    case ScanEvent::kEndSweep:
    case ScanEvent::kCancel:
      return Refuse(state, say::scan::NotRunning());
    case ScanEvent::kShortPress:
    case ScanEvent::kLongPress:
    case ScanEvent::kMonitorStop:
    case ScanEvent::kMonitorEnded:
    case ScanEvent::kSensorLost:
    case ScanEvent::kSensorFailed:
    case ScanEvent::kStorageFailed: {
      ScanTransition end = Settle(state);
      end.actions = {ScanAction::kEndMonitor};
      return end;
    }
    default:
      return Stay(state);
  }
}

ScanTransition InFault(ScanState state, ScanEvent event) {
  const bool is_press = event == ScanEvent::kShortPress || event == ScanEvent::kLongPress;
  const bool is_command = is_press || event == ScanEvent::kStart || event == ScanEvent::kEndSweep ||
                          event == ScanEvent::kCancel;
  if (event == ScanEvent::kMonitorStop) return Refuse(state, say::monitoring::NotRunning());
  if (!is_command && event != ScanEvent::kMonitorStart) return Settle(state);
  if (state.fault == FaultKind::kScan && is_press) {
    state.fault = SensorFault(state);  // it may have failed meanwhile, and reports so only once
    return Settle(state);
  }
  if (state.fault == FaultKind::kStorage) return Refuse(state, say::scan::StorageFailed());
  if (state.fault == FaultKind::kScan) return Refuse(state, say::scan::AcknowledgeFailure());
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
    case ApplianceState::kMonitoring:
      return InMonitoring(state, event);
    case ApplianceState::kFault:
      return InFault(state, event);
  }
  return Stay(state);
}

const char* Name(ScanEvent event) {
  static constexpr auto kNames = NamesUpTo<ScanEvent::kMonitorEnded>(
      {"sensor_ready", "sensor_lost", "sensor_failed", "short_press", "long_press", "start",
       "end_sweep", "cancel", "sweep_complete", "scan_done", "scan_failed", "scan_cancelled",
       "result_expired", "storage_failed", "storage_works", "monitor_start", "monitor_stop",
       "monitor_ended"});
  return kNames.at(static_cast<std::size_t>(event)).data();
}

}  // namespace plumb
