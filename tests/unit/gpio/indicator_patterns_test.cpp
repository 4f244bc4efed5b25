// SPDX-License-Identifier: Apache-2.0
#include "drivers/gpio/indicator_patterns.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace plumb {
namespace {

using std::chrono::milliseconds;
using Clock = IndicatorPlayer::Clock;

std::vector<IndicatorPattern> AllPatterns() {
  std::vector<IndicatorPattern> patterns;
  for (int i = 0; i <= static_cast<int>(IndicatorPattern::kStopped); ++i)
    patterns.push_back(static_cast<IndicatorPattern>(i));
  return patterns;
}

/// What is lit in each 10 ms of 8 s, once the beginning is over; one letter each.
std::string Seen(IndicatorPattern pattern, int mask) {
  IndicatorPlayer player;
  Clock::time_point now{};
  player.Show(pattern, now);
  std::string seen;
  for (int i = 0; i < 1000; ++i, now += milliseconds(10)) {
    player.OnTime(now);
    if (i >= 200) seen += static_cast<char>('A' + (player.outputs() & mask));
  }
  return seen;
}

TEST(IndicatorPatternsTest, EachPatternLooksDifferentEvenInOneColour) {
  for (std::size_t i = 0; i < AllPatterns().size(); ++i) {
    for (std::size_t j = i + 1; j < AllPatterns().size(); ++j) {
      EXPECT_NE(Seen(AllPatterns()[i], kRed | kGreen | kBlue),
                Seen(AllPatterns()[j], kRed | kGreen | kBlue))
          << i << " and " << j;
    }
  }
}

TEST(IndicatorPatternsTest, NothingIsDarkForMoreThanTwoSeconds) {
  for (const IndicatorPattern pattern : AllPatterns()) {
    if (pattern == IndicatorPattern::kOff) continue;
    int dark = 0, longest = 0;
    for (const char c : Seen(pattern, kRed | kGreen | kBlue))
      longest = std::max(longest, dark = c == 'A' ? dark + 1 : 0);
    EXPECT_LE(longest, 200) << static_cast<int>(pattern);
  }
}

TEST(IndicatorPatternsTest, OnlyTooFastGoesOnBeeping) {
  for (const IndicatorPattern pattern : AllPatterns()) {
    const bool beeps = Seen(pattern, kBeeper).find('A' + kBeeper) != std::string::npos;
    EXPECT_EQ(beeps, pattern == IndicatorPattern::kTooFast) << static_cast<int>(pattern);
  }
}

TEST(IndicatorPatternsTest, ShowingTheSameAgainDoesNotStartAnew) {
  IndicatorPlayer player;
  Clock::time_point now{};
  player.Show(IndicatorPattern::kWorking, now);
  const auto deadline = player.deadline();
  player.Show(IndicatorPattern::kWorking, now + milliseconds(100));
  EXPECT_EQ(player.deadline(), deadline);
}

TEST(IndicatorPatternsTest, CatchesUpAfterALongSleep) {
  IndicatorPlayer player;
  Clock::time_point now{};
  player.Show(IndicatorPattern::kFault, now);
  now += std::chrono::hours(100);
  player.OnTime(now);
  ASSERT_TRUE(player.deadline());
  EXPECT_GT(*player.deadline(), now);
}

}  // namespace
}  // namespace plumb
