// SPDX-License-Identifier: Apache-2.0
#include "drivers/gpio/button_debouncer.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace plumb {
namespace {

using std::chrono::milliseconds;

/// A button whose time the test makes; steps to each deadline on the way, as the loop does.
class Bench {
 public:
  explicit Bench(bool held = false) : debouncer_({}, held, now_) {}
  void Level(bool pressed) { Note(debouncer_.OnEdge(pressed, now_)); }
  /// An edge that is read only now.
  void Late(bool pressed, milliseconds ago) { Note(debouncer_.OnEdge(pressed, now_ - ago)); }
  /// What the line itself says.
  void Reread(bool pressed) { Note(debouncer_.OnLevel(pressed, now_)); }
  /// The loop does not come round.
  void Hang(milliseconds time) { now_ += time; }
  void Pass(milliseconds time) {
    const auto end = now_ + time;
    while (debouncer_.deadline() && *debouncer_.deadline() <= end) {
      now_ = std::max(now_, *debouncer_.deadline());
      Step();
    }
    now_ = end;
    Step();
  }
  std::vector<ButtonPress> presses;
  [[nodiscard]] bool idle() const { return !debouncer_.deadline(); }

 private:
  void Note(std::optional<ButtonPress> press) {
    if (press) presses.push_back(*press);
  }
  void Step() { Note(debouncer_.OnTime(now_)); }
  ButtonDebouncer::Clock::time_point now_{std::chrono::hours(1)};
  ButtonDebouncer debouncer_;
};

TEST(ButtonDebouncerTest, ReportsAShortPressWhenItEnds) {
  Bench bench;
  bench.Level(true);
  bench.Pass(milliseconds(200));
  EXPECT_TRUE(bench.presses.empty());
  bench.Level(false);
  bench.Pass(milliseconds(100));
  EXPECT_EQ(bench.presses, std::vector{ButtonPress::kShort});
  EXPECT_TRUE(bench.idle());
}

TEST(ButtonDebouncerTest, ReportsALongPressWhileItIsHeldAndOnlyOnce) {
  Bench bench;
  bench.Level(true);
  bench.Pass(milliseconds(1499));
  EXPECT_TRUE(bench.presses.empty());
  bench.Pass(milliseconds(2));
  EXPECT_EQ(bench.presses, std::vector{ButtonPress::kLong});
  bench.Pass(std::chrono::minutes(1));
  bench.Level(false);
  bench.Pass(milliseconds(100));
  EXPECT_EQ(bench.presses.size(), 1U);
}

TEST(ButtonDebouncerTest, AButtonHeldAtTheStartIsNoPressUntilReleased) {
  Bench bench(true);
  bench.Pass(std::chrono::seconds(10));
  bench.Level(false);
  bench.Pass(milliseconds(100));
  EXPECT_TRUE(bench.presses.empty());
  bench.Level(true);
  bench.Pass(milliseconds(100));
  bench.Level(false);
  bench.Pass(milliseconds(100));
  EXPECT_EQ(bench.presses, std::vector{ButtonPress::kShort});
}

TEST(ButtonDebouncerTest, ASpikeShorterThanTheDebounceIsNothing) {
  Bench bench;
  for (int i = 0; i < 20; ++i) {
    bench.Level(true);
    bench.Pass(milliseconds(10));
    bench.Level(false);
    bench.Pass(milliseconds(500));
  }
  EXPECT_TRUE(bench.presses.empty());
}

TEST(ButtonDebouncerTest, ALossOfContactShorterThanTheDebounceDoesNotEndAPress) {
  Bench bench;
  bench.Level(true);
  bench.Pass(milliseconds(300));
  bench.Level(false);
  bench.Pass(milliseconds(20));
  bench.Level(true);
  bench.Pass(milliseconds(300));
  EXPECT_TRUE(bench.presses.empty());
  bench.Level(false);
  bench.Pass(milliseconds(100));
  EXPECT_EQ(bench.presses.size(), 1U);
}

TEST(ButtonDebouncerTest, EdgesThatAreReadLateCountByWhenTheyHappened) {
  Bench bench;
  bench.Hang(milliseconds(400));
  bench.Late(true, milliseconds(300));
  bench.Late(false, milliseconds(100));
  bench.Pass(milliseconds(0));
  EXPECT_EQ(bench.presses, std::vector{ButtonPress::kShort});
  bench.Hang(std::chrono::seconds(3));
  bench.Late(true, milliseconds(2500));
  bench.Late(false, milliseconds(500));
  bench.Pass(milliseconds(100));
  EXPECT_EQ(bench.presses, (std::vector{ButtonPress::kShort, ButtonPress::kLong}));
  bench.Hang(std::chrono::seconds(3));
  bench.Late(true, milliseconds(500));
  bench.Late(false, milliseconds(490));
  bench.Pass(milliseconds(100));
  EXPECT_EQ(bench.presses.size(), 2U) << "a spike stays one";
}

TEST(ButtonDebouncerTest, AReleaseWhoseEdgeWasLostIsNoLongPress) {
  Bench bench;
  bench.Level(true);
  bench.Hang(std::chrono::seconds(3));
  bench.Reread(false);
  bench.Pass(milliseconds(100));
  EXPECT_EQ(bench.presses, std::vector{ButtonPress::kShort});
  EXPECT_TRUE(bench.idle());
}

TEST(ButtonDebouncerTest, APressWhoseEdgeWasLostBeginsWhenItIsSeen) {
  Bench bench;
  bench.Level(false);
  bench.Hang(std::chrono::seconds(3));
  bench.Reread(true);
  bench.Pass(milliseconds(200));
  EXPECT_TRUE(bench.presses.empty());
  bench.Level(false);
  bench.Pass(milliseconds(100));
  EXPECT_EQ(bench.presses, std::vector{ButtonPress::kShort});
}

// Contacts that chatter for up to 15 ms at each change: exactly one press each time, long or short
// as it was held.
TEST(ButtonDebouncerTest, CountsPressesThroughChatter) {
  std::mt19937 random(11);
  std::uniform_int_distribution<int> bounces(0, 12), gap_ms(0, 2), hold_ms(100, 3000);
  Bench bench;
  std::vector<ButtonPress> expected;
  const auto change = [&](bool to) {
    for (int i = bounces(random); i > 0; --i) {
      bench.Level(to);
      bench.Pass(milliseconds(gap_ms(random)));
      bench.Level(!to);
      bench.Pass(milliseconds(gap_ms(random)));
    }
    bench.Level(to);
  };
  for (int i = 0; i < 300; ++i) {
    int hold = hold_ms(random);
    if (std::abs(hold - 1500) < 120) hold += 300;  // near the limit either is right
    change(true);
    bench.Pass(milliseconds(hold));
    change(false);
    bench.Pass(milliseconds(200));
    expected.push_back(hold > 1500 ? ButtonPress::kLong : ButtonPress::kShort);
  }
  EXPECT_EQ(bench.presses, expected);
}

}  // namespace
}  // namespace plumb
