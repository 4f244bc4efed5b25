#include "drivers/gpio/indicator_patterns.hpp"

#include <array>

namespace plumb {
namespace {

using std::chrono::milliseconds;
constexpr std::uint8_t kYellow = kRed | kGreen;

constexpr std::array kOffSteps{IndicatorStep{0, milliseconds(0)}};
constexpr std::array kNoSensorSteps{IndicatorStep{kRed, milliseconds(150)},
                                    IndicatorStep{0, milliseconds(1850)}};
constexpr std::array kReadySteps{IndicatorStep{kGreen, milliseconds(0)}};
constexpr std::array kScanningSteps{IndicatorStep{kBlue | kBeeper, milliseconds(80)},
                                    IndicatorStep{kBlue, milliseconds(0)}};
constexpr std::array kTooFastSteps{IndicatorStep{kYellow | kBeeper, milliseconds(100)},
                                   IndicatorStep{0, milliseconds(100)}};
constexpr std::array kTooNearSteps{
    IndicatorStep{kYellow, milliseconds(100)}, IndicatorStep{0, milliseconds(150)},
    IndicatorStep{kYellow, milliseconds(100)}, IndicatorStep{0, milliseconds(650)}};
constexpr std::array kTooFarSteps{
    IndicatorStep{kYellow, milliseconds(400)}, IndicatorStep{0, milliseconds(150)},
    IndicatorStep{kYellow, milliseconds(400)}, IndicatorStep{0, milliseconds(650)}};
constexpr std::array kWorkingSteps{IndicatorStep{kBlue, milliseconds(500)},
                                   IndicatorStep{0, milliseconds(500)}};
constexpr std::array kDoneSteps{
    IndicatorStep{kGreen | kBeeper, milliseconds(200)}, IndicatorStep{kGreen, milliseconds(800)},
    IndicatorStep{kBlue, milliseconds(1000)}, IndicatorStep{kGreen, milliseconds(1000)}};
constexpr std::array kInToleranceSteps{
    IndicatorStep{kGreen | kBeeper, milliseconds(200)}, IndicatorStep{kGreen, milliseconds(1800)},
    IndicatorStep{0, milliseconds(200)}, IndicatorStep{kGreen, milliseconds(1800)}};
// Green for the values, yellow for their uncertainty; never green alone.
constexpr std::array kUnsureSteps{
    IndicatorStep{kYellow | kBeeper, milliseconds(200)}, IndicatorStep{kYellow, milliseconds(600)},
    IndicatorStep{kGreen, milliseconds(600)}, IndicatorStep{kYellow, milliseconds(600)}};
constexpr std::array kMoveSteps{
    IndicatorStep{kYellow | kBeeper, milliseconds(200)}, IndicatorStep{kYellow, milliseconds(800)},
    IndicatorStep{0, milliseconds(800)}, IndicatorStep{kYellow, milliseconds(800)}};
constexpr std::array kNoAnswerSteps{
    IndicatorStep{kRed | kBeeper, milliseconds(100)}, IndicatorStep{0, milliseconds(100)},
    IndicatorStep{kRed | kBeeper, milliseconds(100)}, IndicatorStep{kRed, milliseconds(300)},
    IndicatorStep{0, milliseconds(300)}};
constexpr std::array kFaultSteps{IndicatorStep{kRed, milliseconds(80)},
                                 IndicatorStep{0, milliseconds(80)}};

// Similar to ready, because scans are possible.
constexpr std::array kReadyRolledBackSteps{IndicatorStep{kGreen, milliseconds(1500)},
                                           IndicatorStep{kRed, milliseconds(300)}};

constexpr std::array kReadyDiskNearlyFullSteps{
    IndicatorStep{kGreen, milliseconds(1500)}, IndicatorStep{kRed | kGreen, milliseconds(150)},
    IndicatorStep{kGreen, milliseconds(150)}, IndicatorStep{kRed | kGreen, milliseconds(150)}};

// Slow, so that it is not mistaken for an error of a running service.
constexpr std::array kStoppedSteps{IndicatorStep{kRed, milliseconds(1000)},
                                   IndicatorStep{0, milliseconds(1000)}};

constexpr int kMaxCatchUp = 64;  // steps; after a longer delay of the loop the rhythm starts again

}  // namespace

IndicatorProgram ProgramOf(IndicatorPattern pattern) {
  switch (pattern) {
    case IndicatorPattern::kOff:
      return {kOffSteps};
    case IndicatorPattern::kNoSensor:
      return {kNoSensorSteps};
    case IndicatorPattern::kReady:
      return {kReadySteps};
    case IndicatorPattern::kScanning:
      return {kScanningSteps};
    case IndicatorPattern::kTooFast:
      return {kTooFastSteps};
    case IndicatorPattern::kTooNear:
      return {kTooNearSteps};
    case IndicatorPattern::kTooFar:
      return {kTooFarSteps};
    case IndicatorPattern::kWorking:
      return {kWorkingSteps};
    case IndicatorPattern::kDone:
      return {kDoneSteps, 2};
    case IndicatorPattern::kResultInTolerance:
      return {kInToleranceSteps, 2};
    case IndicatorPattern::kResultUnsure:
      return {kUnsureSteps, 2};
    case IndicatorPattern::kResultMove:
      return {kMoveSteps, 2};
    case IndicatorPattern::kNoAnswer:
      return {kNoAnswerSteps, 3};
    case IndicatorPattern::kFault:
      return {kFaultSteps};
    case IndicatorPattern::kReadyRolledBack:
      return {kReadyRolledBackSteps};
    case IndicatorPattern::kReadyDiskNearlyFull:
      return {kReadyDiskNearlyFullSteps};
    case IndicatorPattern::kStopped:
      return {kStoppedSteps};
  }
  return {kFaultSteps};
}

void IndicatorPlayer::Show(IndicatorPattern pattern, Clock::time_point now) {
  if (pattern == pattern_) return;
  pattern_ = pattern;
  program_ = ProgramOf(pattern);
  step_ = 0;
  step_begin_ = now;
}

std::optional<IndicatorPlayer::Clock::time_point> IndicatorPlayer::deadline() const {
  const milliseconds length = program_.steps[step_].length;
  if (length == milliseconds(0)) return std::nullopt;
  return step_begin_ + length;
}

void IndicatorPlayer::OnTime(Clock::time_point now) {
  for (int i = 0; deadline() && *deadline() <= now; ++i) {
    step_begin_ = i < kMaxCatchUp ? *deadline() : now;
    step_ = step_ + 1 < program_.steps.size() ? step_ + 1 : program_.repeat_from;
  }
}

}  // namespace plumb
