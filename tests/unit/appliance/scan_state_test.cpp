// SPDX-License-Identifier: Apache-2.0
// Every state with every event: what must hold everywhere, and the table of what each one leads to.
#include "daemon/appliance/scan_state.hpp"

#include <algorithm>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "words/scan.hpp"

namespace plumb {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using enum ApplianceState;
using E = ScanEvent;
using A = ScanAction;

constexpr int kNumEvents = static_cast<int>(E::kMonitorEnded) + 1;

bool IsRunning(const ScanState& s) { return s.phase == kScanning || s.phase == kWorking; }

/// What the header promises of a state.
bool IsConsistent(const ScanState& s) {
  if (s.cancelling && !IsRunning(s)) return false;
  if (s.sensor_fails && (s.has_sensor || s.fault == FaultKind::kNone)) return false;
  if (s.fault == FaultKind::kSensor && !s.sensor_fails) return false;
  if (s.phase == kFault) return s.fault != FaultKind::kNone;
  if (s.phase == kReady || s.phase == kMonitoring)
    return s.has_sensor && s.fault == FaultKind::kNone;
  if (s.phase == kNoSensor) return !s.has_sensor && s.fault == FaultKind::kNone;
  return true;
}

/// Every state that events can lead to, from the start on.
std::vector<ScanState> ReachableStates() {
  std::vector<ScanState> states = {ScanState{}};
  for (std::size_t i = 0; i < states.size(); ++i) {
    for (int e = 0; e < kNumEvents; ++e) {
      const ScanState next = Next(states[i], static_cast<E>(e)).state;
      if (std::find(states.begin(), states.end(), next) == states.end()) states.push_back(next);
    }
  }
  return states;
}

std::string Text(const ScanState& s, E e) {
  return std::string(Name(s.phase)) + (s.has_sensor ? " sensor" : "") +
         (s.sensor_fails ? " failing" : "") + (s.cancelling ? " cancelling" : "") + " fault " +
         std::to_string(static_cast<int>(s.fault)) + " on " + Name(e);
}

template <typename Check>
void ForEveryStateAndEvent(const Check& check) {
  for (const ScanState& state : ReachableStates()) {
    for (int e = 0; e < kNumEvents; ++e) {
      const auto event = static_cast<E>(e);
      SCOPED_TRACE(Text(state, event));
      check(state, event, Next(state, event));
    }
  }
}

TEST(ScanStateTest, ReachesAllStatesAndOnlyConsistentOnes) {
  const std::vector<ScanState> states = ReachableStates();
  for (const ApplianceState phase :
       {kNoSensor, kReady, kScanning, kWorking, kResult, kMonitoring, kFault}) {
    EXPECT_TRUE(std::any_of(states.begin(), states.end(), [&](const ScanState& s) {
      return s.phase == phase;
    })) << Name(phase);
  }
  for (const ScanState& state : states) EXPECT_TRUE(IsConsistent(state)) << Text(state, E::kStart);
}

TEST(ScanStateTest, EachRefusalSaysWhyAndEachReasonIsARefusal) {
  ForEveryStateAndEvent([](const ScanState&, E, const ScanTransition& t) {
    const bool refused = std::count(t.actions.begin(), t.actions.end(), A::kRefuse) > 0;
    EXPECT_EQ(refused, !t.refusal.empty());
  });
}

TEST(ScanStateTest, AScanStartsOnlyWithAWorkingSensorAndNoScanUnderWay) {
  ForEveryStateAndEvent([](const ScanState& before, E event, const ScanTransition& t) {
    if (std::count(t.actions.begin(), t.actions.end(), A::kStartScan) == 0) return;
    EXPECT_TRUE(before.phase == kReady || before.phase == kResult || before.phase == kMonitoring);
    EXPECT_TRUE(before.has_sensor && before.fault == FaultKind::kNone);
    EXPECT_TRUE(event == E::kShortPress || event == E::kStart);
    EXPECT_EQ(t.state.phase, kScanning);
  });
}

TEST(ScanStateTest, MonitoringBeginsAndEndsWithItsPhase) {
  ForEveryStateAndEvent([](const ScanState& before, E event, const ScanTransition& t) {
    const bool was = before.phase == kMonitoring, is = t.state.phase == kMonitoring;
    EXPECT_EQ(std::count(t.actions.begin(), t.actions.end(), A::kStartMonitor), !was && is);
    EXPECT_EQ(std::count(t.actions.begin(), t.actions.end(), A::kEndMonitor), was && !is);
    if (!was && is) {
      EXPECT_EQ(event, E::kMonitorStart);
    }
    // A sweep and monitoring share the sensor: first the one ends, then the other begins.
    if (was && t.state.phase == kScanning) {
      EXPECT_THAT(t.actions, ElementsAre(A::kEndMonitor, A::kStartScan));
    }
  });
}

TEST(ScanStateTest, ARunningScanIsNeverForgotten) {
  // Only the scan's own end events may leave its phases; no other event may change the state.
  ForEveryStateAndEvent([](const ScanState& before, E event, const ScanTransition& t) {
    if (!IsRunning(before)) return;
    const bool is_end =
        event == E::kScanDone || event == E::kScanFailed || event == E::kScanCancelled;
    EXPECT_EQ(IsRunning(t.state), !is_end);
  });
}

TEST(ScanStateTest, AScanIsToldToStopOnce) {
  ForEveryStateAndEvent([](const ScanState& before, E, const ScanTransition& t) {
    const bool cancels = std::count(t.actions.begin(), t.actions.end(), A::kCancelScan) > 0;
    if (cancels) {
      EXPECT_TRUE(IsRunning(before));
      EXPECT_FALSE(before.cancelling);
      EXPECT_TRUE(t.state.cancelling);
    }
    if (before.cancelling) {
      EXPECT_THAT(t.actions, ::testing::Not(Contains(A::kEndSweep)));
    }
  });
}

TEST(ScanStateTest, StorageFailureLastsUntilTheStorageWorks) {
  ForEveryStateAndEvent([](const ScanState& before, E event, const ScanTransition& t) {
    if (before.fault != FaultKind::kStorage) return;
    if (event == E::kStorageWorks) {
      EXPECT_EQ(t.state.fault, before.sensor_fails ? FaultKind::kSensor : FaultKind::kNone);
      return;
    }
    EXPECT_EQ(t.state.fault, FaultKind::kStorage);
    EXPECT_TRUE(IsRunning(t.state) || t.state.phase == kFault);
  });
}

TEST(ScanStateTest, TheSensorIsKnownInEveryState) {
  ForEveryStateAndEvent([](const ScanState& before, E event, const ScanTransition& t) {
    const bool expected =
        event == E::kSensorReady ||
        (before.has_sensor && event != E::kSensorLost && event != E::kSensorFailed);
    EXPECT_EQ(t.state.has_sensor, expected);
    const bool fails = event == E::kSensorFailed ||
                       (before.sensor_fails && event != E::kSensorReady && event != E::kSensorLost);
    EXPECT_EQ(t.state.sensor_fails, fails);
  });
}

ScanTransition After(const std::vector<E>& events) {
  ScanTransition t;
  for (const E event : events) t = Next(t.state, event);
  return t;
}

// The failure is reported only once, so no other event may make the appliance ask for a sensor that
// is attached.
TEST(ScanStateTest, ASensorThatFailsDuringAnotherFaultFailsStillWhenThatIsOver) {
  ScanTransition t = After({E::kSensorReady, E::kStart, E::kScanFailed, E::kSensorFailed});
  EXPECT_EQ(t.state.fault, FaultKind::kScan);
  t = Next(t.state, E::kShortPress);
  EXPECT_EQ(t.state.phase, kFault);
  EXPECT_EQ(t.state.fault, FaultKind::kSensor);
  EXPECT_EQ(Next(t.state, E::kSensorReady).state.phase, kReady);

  t = After({E::kSensorReady, E::kStart, E::kSensorFailed, E::kScanFailed, E::kShortPress});
  EXPECT_EQ(t.state.fault, FaultKind::kSensor);
  t = After({E::kSensorReady, E::kStart, E::kSensorFailed, E::kScanFailed, E::kSensorLost,
             E::kShortPress});
  EXPECT_EQ(t.state.phase, kNoSensor);
}

TEST(ScanStateTest, ARefusalTellsASensorThatFailsFromNone) {
  const std::vector<E> result = {E::kSensorReady, E::kStart, E::kEndSweep};
  for (const E press : {E::kShortPress, E::kStart}) {
    std::vector<E> events = result;
    events.insert(events.end(), {E::kSensorFailed, E::kScanDone, press});
    EXPECT_TRUE(After(events).refusal.Is(say::scan::kSensorFails));
    events = result;
    events.insert(events.end(), {E::kSensorLost, E::kScanDone, press});
    EXPECT_TRUE(After(events).refusal.Is(say::scan::kPlugSensorIn));
  }
}

TEST(ScanStateTest, ThePlainWay) {
  ScanTransition t = Next({}, E::kSensorReady);
  EXPECT_EQ(t.state.phase, kReady);
  t = Next(t.state, E::kShortPress);
  EXPECT_EQ(t.state.phase, kScanning);
  EXPECT_THAT(t.actions, ElementsAre(A::kStartScan));
  t = Next(t.state, E::kSweepComplete);
  EXPECT_EQ(t.state.phase, kWorking);
  EXPECT_THAT(t.actions, ElementsAre(A::kEndSweep));
  t = Next(t.state, E::kScanDone);
  EXPECT_EQ(t.state.phase, kResult);
  EXPECT_THAT(t.actions, ElementsAre(A::kArmResultTimer));
  EXPECT_EQ(Next(t.state, E::kShortPress).state.phase, kScanning);
  EXPECT_EQ(Next(t.state, E::kResultExpired).state.phase, kReady);
}

struct Row {
  ScanState from;
  E event;
  ScanState to;
  std::vector<A> actions;
};

constexpr ScanState kInNoSensor{};
constexpr ScanState kInReady{.phase = kReady, .has_sensor = true};
constexpr ScanState kInScanning{.phase = kScanning, .has_sensor = true};
constexpr ScanState kInWorking{.phase = kWorking, .has_sensor = true};
constexpr ScanState kInResult{.phase = kResult, .has_sensor = true};
constexpr ScanState kInMonitoring{.phase = kMonitoring, .has_sensor = true};
constexpr ScanState kSensorFault{
    .phase = kFault, .sensor_fails = true, .fault = FaultKind::kSensor};
constexpr ScanState kScanFault{.phase = kFault, .has_sensor = true, .fault = FaultKind::kScan};
constexpr ScanState kStorageFault{
    .phase = kFault, .has_sensor = true, .fault = FaultKind::kStorage};
constexpr ScanState kCancelling{.phase = kScanning, .has_sensor = true, .cancelling = true};
constexpr ScanState kUnplugged{.phase = kScanning, .has_sensor = false, .cancelling = true};
constexpr ScanState kStalled{
    .phase = kScanning, .sensor_fails = true, .fault = FaultKind::kSensor, .cancelling = true};

TEST(ScanStateTest, TheTable) {
  const std::vector<Row> rows = {
      {kInNoSensor, E::kSensorFailed, kSensorFault, {}},
      {kInNoSensor, E::kShortPress, kInNoSensor, {A::kRefuse}},
      {kInNoSensor, E::kScanDone, kInNoSensor, {}},
      {kInReady, E::kSensorLost, kInNoSensor, {}},
      {kInReady, E::kSensorFailed, kSensorFault, {}},
      {kInReady, E::kStart, kInScanning, {A::kStartScan}},
      {kInReady, E::kLongPress, kInReady, {A::kRefuse}},
      {kInReady, E::kStorageFailed, kStorageFault, {}},
      {kInReady, E::kResultExpired, kInReady, {}},
      {kInScanning, E::kShortPress, kInWorking, {A::kEndSweep}},
      {kInScanning, E::kStart, kInScanning, {A::kRefuse}},
      {kInScanning, E::kLongPress, kCancelling, {A::kCancelScan}},
      {kInScanning, E::kCancel, kCancelling, {A::kCancelScan}},
      {kInScanning, E::kSensorLost, kUnplugged, {A::kCancelScan}},
      {kInScanning, E::kSensorFailed, kStalled, {A::kCancelScan}},
      {kInScanning, E::kScanFailed, kScanFault, {}},
      {kCancelling, E::kShortPress, kCancelling, {A::kRefuse}},
      {kCancelling, E::kSweepComplete, kCancelling, {}},
      {kCancelling, E::kScanCancelled, kInReady, {}},
      {kUnplugged, E::kScanCancelled, kInNoSensor, {}},
      {kUnplugged, E::kSensorReady, kCancelling, {}},
      {kStalled, E::kScanCancelled, kSensorFault, {}},
      {kInWorking, E::kShortPress, kInWorking, {A::kRefuse}},
      {kInWorking, E::kSensorLost, {.phase = kWorking}, {}},
      {{.phase = kWorking}, E::kScanDone, {.phase = kResult}, {A::kArmResultTimer}},
      {{.phase = kResult}, E::kShortPress, kInNoSensor, {A::kRefuse}},
      {kInWorking, E::kScanFailed, kScanFault, {}},
      {kInResult, E::kLongPress, kInReady, {}},
      {kInResult, E::kSensorLost, kInNoSensor, {}},
      {kInResult, E::kStart, kInScanning, {A::kStartScan}},
      {kSensorFault, E::kSensorReady, kInReady, {}},
      {kSensorFault, E::kSensorLost, kInNoSensor, {}},
      {kSensorFault, E::kShortPress, kSensorFault, {A::kRefuse}},
      {kScanFault, E::kShortPress, kInReady, {}},
      {kScanFault, E::kStart, kScanFault, {A::kRefuse}},
      {kStorageFault, E::kShortPress, kStorageFault, {A::kRefuse}},
      {kStorageFault, E::kStorageWorks, kInReady, {}},
      {kInReady, E::kStorageWorks, kInReady, {}},
      {kScanFault, E::kStorageWorks, kScanFault, {}},
      {kInScanning, E::kStorageWorks, kInScanning, {}},
      {kInReady, E::kMonitorStart, kInMonitoring, {A::kStartMonitor}},
      {kInResult, E::kMonitorStart, kInMonitoring, {A::kStartMonitor}},
      {kInScanning, E::kMonitorStart, kInScanning, {A::kRefuse}},
      {kInWorking, E::kMonitorStart, kInWorking, {A::kRefuse}},
      {kInNoSensor, E::kMonitorStart, kInNoSensor, {A::kRefuse}},
      {kScanFault, E::kMonitorStart, kScanFault, {A::kRefuse}},
      {kInReady, E::kMonitorStop, kInReady, {A::kRefuse}},
      {kInMonitoring, E::kMonitorStart, kInMonitoring, {A::kRefuse}},
      {kInMonitoring, E::kCancel, kInMonitoring, {A::kRefuse}},
      {kInMonitoring, E::kMonitorStop, kInReady, {A::kEndMonitor}},
      {kInMonitoring, E::kShortPress, kInReady, {A::kEndMonitor}},
      {kInMonitoring, E::kLongPress, kInReady, {A::kEndMonitor}},
      {kInMonitoring, E::kMonitorEnded, kInReady, {A::kEndMonitor}},
      {kInMonitoring, E::kStart, kInScanning, {A::kEndMonitor, A::kStartScan}},
      {kInMonitoring, E::kSensorLost, kInNoSensor, {A::kEndMonitor}},
      {kInMonitoring, E::kSensorFailed, kSensorFault, {A::kEndMonitor}},
      {kInMonitoring, E::kStorageFailed, kStorageFault, {A::kEndMonitor}},
      {kInMonitoring, E::kResultExpired, kInMonitoring, {}},
  };
  for (const Row& row : rows) {
    SCOPED_TRACE(Text(row.from, row.event));
    const ScanTransition t = Next(row.from, row.event);
    EXPECT_EQ(t.state, row.to) << "led to " << Text(t.state, row.event);
    EXPECT_EQ(t.actions, row.actions);
  }
}

}  // namespace
}  // namespace plumb
