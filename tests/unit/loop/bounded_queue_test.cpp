// SPDX-License-Identifier: Apache-2.0
#include "daemon/loop/bounded_queue.hpp"

#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace plumb {
namespace {

TEST(BoundedQueueTest, KeepsTheOrderAcrossThreadsAndBlocksWhenFull) {
  BoundedQueue<int> queue(2);
  std::jthread writer([&queue] {
    for (int i = 0; i < 1000; ++i) EXPECT_TRUE(queue.Push(i));
    queue.Close();
  });
  std::vector<int> seen;
  while (const std::optional<int> value = queue.Pop()) seen.push_back(*value);
  ASSERT_EQ(seen.size(), 1000U);
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(seen[static_cast<std::size_t>(i)], i);
}

TEST(BoundedQueueTest, DropsTheOldestWhenLive) {
  BoundedQueue<int> queue(2);
  EXPECT_EQ(queue.PushDroppingOldest(1), 0);
  EXPECT_EQ(queue.PushDroppingOldest(2), 0);
  EXPECT_EQ(queue.PushDroppingOldest(3), 1);
  EXPECT_EQ(queue.Pop(), 2);
  EXPECT_EQ(queue.Pop(), 3);
}

TEST(BoundedQueueTest, HandsOutTheRestAfterClosing) {
  BoundedQueue<int> queue(4);
  queue.Push(7);
  queue.Close();
  EXPECT_FALSE(queue.Push(8));
  EXPECT_EQ(queue.PushDroppingOldest(8), 1);
  EXPECT_EQ(queue.Pop(), 7);
  EXPECT_EQ(queue.Pop(), std::nullopt);
}

TEST(BoundedQueueTest, AStopWakesAWaitingReader) {
  BoundedQueue<int> queue(1);
  std::stop_source stop;
  std::jthread stopper([&stop] { stop.request_stop(); });
  EXPECT_EQ(queue.Pop(stop.get_token()), std::nullopt);
}

TEST(BoundedQueueTest, AStopWakesAWaitingWriter) {
  BoundedQueue<int> queue(1);
  queue.Push(1);
  std::stop_source stop;
  std::jthread stopper([&stop] { stop.request_stop(); });
  EXPECT_FALSE(queue.Push(2, stop.get_token()));
}

}  // namespace
}  // namespace plumb
