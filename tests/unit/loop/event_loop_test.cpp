// SPDX-License-Identifier: Apache-2.0
#include "daemon/loop/event_loop.hpp"

#include <signal.h>
#include <sys/epoll.h>
#include <unistd.h>

#include <array>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace plumb {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;

TEST(EventLoopTest, RunsWhatOtherThreadsPostInOrderOnItsOwnThread) {
  EventLoop loop;
  std::vector<int> seen;
  bool on_own_thread = true;
  const std::thread::id own = std::this_thread::get_id();
  std::jthread poster([&] {
    for (int i = 0; i < 1000; ++i) {
      loop.Post("test", [&, i] {
        seen.push_back(i);
        on_own_thread = on_own_thread && std::this_thread::get_id() == own;
      });
    }
    loop.Quit(7);
  });
  EXPECT_EQ(loop.Run(), 7);
  ASSERT_EQ(seen.size(), 1000U);
  EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end()));
  EXPECT_TRUE(on_own_thread);
}

TEST(EventLoopTest, WorkMayPostFurtherWork) {
  EventLoop loop;
  int depth = 0;
  std::function<void()> again = [&] {
    if (++depth == 5) {
      loop.Quit(0);
    } else {
      loop.Post("test", again);
    }
  };
  loop.Post("test", again);
  EXPECT_EQ(loop.Run(), 0);
  EXPECT_EQ(depth, 5);
}

TEST(EventLoopTest, TimersExpireOnceInTheOrderOfTheirTimesAndNotBefore) {
  EventLoop loop;
  std::vector<int> seen;
  const auto start = EventLoop::Clock::now();
  EventLoop::Source late = loop.MakeTimer("test", [&] { seen.push_back(2), loop.Quit(0); });
  EventLoop::Source early = loop.MakeTimer("test", [&] { seen.push_back(1); });
  EventLoop::Source never = loop.MakeTimer("test", [&] { seen.push_back(3); });
  late.ArmAfter(milliseconds(30));
  early.ArmAfter(milliseconds(10));
  never.ArmAfter(milliseconds(5));
  never.Disarm();
  EXPECT_TRUE(late.is_armed());
  EXPECT_FALSE(never.is_armed());
  EXPECT_EQ(loop.Run(), 0);
  EXPECT_THAT(seen, ElementsAre(1, 2));
  EXPECT_GE(EventLoop::Clock::now() - start, milliseconds(30));
  EXPECT_FALSE(late.is_armed());
}

TEST(EventLoopTest, ADescriptorIsWatchedUntilItsSourceGoesEvenInItsOwnCallback) {
  EventLoop loop;
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  int calls = 0;
  EventLoop::Source source;
  source = loop.WatchDescriptor("test", ends[0], EPOLLIN, [&](std::uint32_t events) {
    EXPECT_NE(events & EPOLLIN, 0U);
    ++calls;
    source = {};  // what is readable stays so: a source that lived on would be called again
    loop.Post("test", [&] { loop.Quit(0); });
  });
  ASSERT_EQ(::write(ends[1], "x", 1), 1);
  EXPECT_EQ(loop.Run(), 0);
  EXPECT_EQ(calls, 1);
  ::close(ends[0]);
  ::close(ends[1]);
}

TEST(EventLoopTest, SignalsArriveAsCalls) {
  EventLoop loop;
  std::vector<int> seen;
  const EventLoop::Source hup =
      loop.WatchSignal(SIGHUP, [&] { seen.push_back(SIGHUP), ::kill(::getpid(), SIGTERM); });
  const EventLoop::Source term =
      loop.WatchSignal(SIGTERM, [&] { seen.push_back(SIGTERM), loop.Quit(0); });
  ::kill(::getpid(), SIGHUP);
  EXPECT_EQ(loop.Run(), 0);
  EXPECT_THAT(seen, ElementsAre(SIGHUP, SIGTERM));
}

TEST(EventLoopTest, WhatACallbackThrowsComesOutOfRun) {
  EventLoop loop;
  int later = 0;
  loop.Post("test", [] { throw std::runtime_error("broken"); });
  loop.Post("test", [&] { ++later; });
  EXPECT_THROW(loop.Run(), std::runtime_error);
  EXPECT_EQ(later, 0);
}

}  // namespace
}  // namespace plumb
