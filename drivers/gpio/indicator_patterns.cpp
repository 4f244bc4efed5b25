// SPDX-License-Identifier: Apache-2.0
#include "drivers/gpio/indicator_patterns.hpp"

namespace plumb {
namespace {

using namespace std::chrono_literals;
using std::chrono::milliseconds;
constexpr std::uint8_t kYellow = kRed | kGreen;

using enum IndicatorPattern;
constexpr std::array kPrograms = {
    IndicatorProgram(kOff, {{0, 0ms}}),
    IndicatorProgram(kNoSensor, {{kRed, 150ms}, {0, 1850ms}}),
    IndicatorProgram(kReady, {{kGreen, 0ms}}),
    IndicatorProgram(kScanning, {{kBlue | kBeeper, 80ms}, {kBlue, 0ms}}),
    IndicatorProgram(kTooFast, {{kYellow | kBeeper, 100ms}, {0, 100ms}}),
    IndicatorProgram(kTooNear, {{kYellow, 100ms}, {0, 150ms}, {kYellow, 100ms}, {0, 650ms}}),
    IndicatorProgram(kTooFar, {{kYellow, 400ms}, {0, 150ms}, {kYellow, 400ms}, {0, 650ms}}),
    IndicatorProgram(kWorking, {{kBlue, 500ms}, {0, 500ms}}),
    IndicatorProgram(
        kDone, {{kGreen | kBeeper, 200ms}, {kGreen, 800ms}, {kBlue, 1000ms}, {kGreen, 1000ms}}, 2),
    IndicatorProgram(kResultInTolerance,
                     {{kGreen | kBeeper, 200ms}, {kGreen, 1800ms}, {0, 200ms}, {kGreen, 1800ms}},
                     2),
    // Green for the values, yellow for their uncertainty; never green alone.
    IndicatorProgram(
        kResultUnsure,
        {{kYellow | kBeeper, 200ms}, {kYellow, 600ms}, {kGreen, 600ms}, {kYellow, 600ms}}, 2),
    IndicatorProgram(kResultMove,
                     {{kYellow | kBeeper, 200ms}, {kYellow, 800ms}, {0, 800ms}, {kYellow, 800ms}},
                     2),
    IndicatorProgram(
        kNoAnswer,
        {{kRed | kBeeper, 100ms}, {0, 100ms}, {kRed | kBeeper, 100ms}, {kRed, 300ms}, {0, 300ms}},
        3),
    IndicatorProgram(kFault, {{kRed, 80ms}, {0, 80ms}}),
    // Similar to ready, because scans are possible.
    IndicatorProgram(kReadyRolledBack, {{kGreen, 1500ms}, {kRed, 300ms}}),
    IndicatorProgram(kReadyDiskNearlyFull,
                     {{kGreen, 1500ms}, {kYellow, 150ms}, {kGreen, 150ms}, {kYellow, 150ms}}),
    IndicatorProgram(kReadyGuessed,
                     {{kGreen, 1500ms}, {kRed, 100ms}, {kGreen, 100ms}, {kRed, 100ms}}),
    // Ready and monitoring, since a press starts the latter.
    IndicatorProgram(kReadyToMonitor,
                     {{kGreen, 1500ms}, {kBlue, 200ms}, {kGreen, 200ms}, {kBlue, 200ms}}),
    IndicatorProgram(kMonitorStarting, {{kBlue, 200ms}, {0, 200ms}, {kBlue, 200ms}, {0, 900ms}}),
    IndicatorProgram(kMonitorIn, {{kGreen, 900ms}, {0, 100ms}}),
    IndicatorProgram(kMonitorOut, {{kYellow, 250ms}, {0, 250ms}}),
    IndicatorProgram(kMonitorUnknown, {{kRed, 600ms}, {0, 150ms}, {kRed, 100ms}, {0, 150ms}}),
    // Slow, so that it is not mistaken for an error of a running service.
    IndicatorProgram(kStopped, {{kRed, 1000ms}, {0, 1000ms}}),
};

constexpr bool IsInOrder() {
  for (std::size_t i = 0; i < kPrograms.size(); ++i)
    if (kPrograms[i].pattern != static_cast<IndicatorPattern>(i)) return false;
  return kPrograms.back().pattern == kStopped;
}
static_assert(IsInOrder(), "a program for each pattern, in the order of the enumerators");

constexpr int kMaxCatchUp = 64;  // steps; after a longer delay of the loop the rhythm starts again

}  // namespace

const IndicatorProgram& ProgramOf(IndicatorPattern pattern) {
  return kPrograms.at(static_cast<std::size_t>(pattern));
}

void IndicatorPlayer::Show(IndicatorPattern pattern, Clock::time_point now) {
  if (pattern == program_->pattern) return;
  program_ = &ProgramOf(pattern);
  step_ = 0;
  step_begin_ = now;
}

std::optional<IndicatorPlayer::Clock::time_point> IndicatorPlayer::deadline() const {
  const milliseconds length = program_->steps[step_].length;
  if (length == milliseconds(0)) return std::nullopt;
  return step_begin_ + length;
}

void IndicatorPlayer::OnTime(Clock::time_point now) {
  for (int i = 0; deadline() && *deadline() <= now; ++i) {
    step_begin_ = i < kMaxCatchUp ? *deadline() : now;
    step_ = step_ + 1 < program_->num_steps ? step_ + 1 : program_->repeat_from;
  }
}

}  // namespace plumb
