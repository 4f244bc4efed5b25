// SPDX-License-Identifier: Apache-2.0
#include "drivers/live/frame_pairing.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace plumb {
namespace {

constexpr std::int64_t kPeriod = 33333;
constexpr std::int64_t kGap = 16000;
using Pairing = FramePairing<int>;

TEST(FramePairingTest, PairsWhicheverStreamComesFirst) {
  Pairing pairing(kGap);
  EXPECT_FALSE(pairing.Add(StreamKind::kColor, 1000, 1));
  const auto first = pairing.Add(StreamKind::kDepth, 6000, 2);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->color, 1);
  EXPECT_EQ(first->depth, 2);
  EXPECT_EQ(first->depth_us, 6000);
  EXPECT_FALSE(pairing.Add(StreamKind::kDepth, 1000 + kPeriod, 3));
  EXPECT_TRUE(pairing.Add(StreamKind::kColor, 2000 + kPeriod, 4));
  EXPECT_EQ(pairing.num_unpaired(), 0);
}

TEST(FramePairingTest, LeavesOutImagesFurtherApartThanTheGap) {
  Pairing pairing(kGap);
  EXPECT_FALSE(pairing.Add(StreamKind::kColor, 0, 1));
  EXPECT_FALSE(pairing.Add(StreamKind::kDepth, kGap + 1, 2));
  EXPECT_TRUE(pairing.Add(StreamKind::kColor, kGap + 1, 3));
  EXPECT_EQ(pairing.num_unpaired(), 1);
}

TEST(FramePairingTest, DiscardsWhatComesTwiceOrOutOfOrder) {
  Pairing pairing(kGap);
  EXPECT_FALSE(pairing.Add(StreamKind::kColor, 100000, 1));
  EXPECT_FALSE(pairing.Add(StreamKind::kColor, 100000, 2));
  EXPECT_FALSE(pairing.Add(StreamKind::kColor, 50000, 3));
  const auto pair = pairing.Add(StreamKind::kDepth, 100000, 4);
  ASSERT_TRUE(pair);
  EXPECT_EQ(pair->color, 1);
  EXPECT_EQ(pairing.num_discarded(), 2);
}

TEST(FramePairingTest, ForgetsTheOldestOfAStreamWhoseOtherIsSilent) {
  Pairing pairing(kGap);
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(pairing.Add(StreamKind::kDepth, i * kPeriod, i));
  EXPECT_GE(pairing.num_unpaired(), 90);
  const auto pair = pairing.Add(StreamKind::kColor, 99 * kPeriod, 0);
  ASSERT_TRUE(pair);
  EXPECT_EQ(pair->depth, 99);
}

// Losses, jitter and any interleaving: every pair made must be the true one, and none that both
// arrived for may be missed.
TEST(FramePairingTest, FindsTheTruePartnersUnderLossesAndJitter) {
  std::mt19937 random(5);
  std::uniform_int_distribution<int> jitter(-400, 400), percent(0, 99), delay(4000, 8000);
  for (int round = 0; round < 50; ++round) {
    Pairing pairing(kGap);
    const int depth_delay = delay(random);
    int expected = 0, found = 0;
    for (int i = 0; i < 200; ++i) {
      const bool color_comes = percent(random) >= 10, depth_comes = percent(random) >= 10;
      const std::int64_t color_us = 1000000 + i * kPeriod + jitter(random);
      const std::int64_t depth_us = color_us + depth_delay + jitter(random);
      expected += color_comes && depth_comes ? 1 : 0;
      const bool depth_first = percent(random) < 50;
      for (const bool depth : {depth_first, !depth_first}) {
        if (!(depth ? depth_comes : color_comes)) continue;
        if (const auto pair = pairing.Add(depth ? StreamKind::kDepth : StreamKind::kColor,
                                          depth ? depth_us : color_us, i)) {
          EXPECT_EQ(pair->color, pair->depth);
          ++found;
        }
      }
    }
    EXPECT_EQ(found, expected);
  }
}

}  // namespace
}  // namespace plumb
