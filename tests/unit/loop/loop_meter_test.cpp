// SPDX-License-Identifier: Apache-2.0
#include "daemon/loop/loop_meter.hpp"

#include <poll.h>
#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "daemon/loop/event_loop.hpp"
#include "daemon/loop/loop_report.hpp"
#include "tests/support/skip.hpp"

namespace plumb {
namespace {

using namespace std::chrono_literals;
using std::chrono::nanoseconds;
using ::testing::HasSubstr;
using ::testing::Not;

/// Clocks that stand still until a test moves them.
struct HandClocks {
  nanoseconds wall{1h}, cpu{3min}, queued{7s};

  [[nodiscard]] LoopClocks Get() {
    return {.wall = [this] { return wall; },
            .cpu = [this] { return cpu; },
            .queued = [this] { return queued; }};
  }
  void Work(nanoseconds time) { wall += time, cpu += time; }
  void Queue(nanoseconds time) { wall += time, queued += time; }
  void Block(nanoseconds time) { wall += time; }
};

class LoopMeterTest : public ::testing::Test {
 protected:
  template <typename Body>
  void Turn(std::string_view what, Body body) {
    meter_.Begin(what);
    body();
    meter_.End();
  }

  HandClocks clocks_;
  LoopMeter meter_{clocks_.Get()};
};

TEST_F(LoopMeterTest, TellsWorkFromWaitingForAProcessorAndFromWaitingForElse) {
  Turn("disk", [&] { clocks_.Work(2ms), clocks_.Queue(5ms), clocks_.Block(30ms); });
  ASSERT_TRUE(meter_.longest());
  EXPECT_EQ(meter_.longest()->what, "disk");
  EXPECT_EQ(meter_.longest()->wall, 37ms);
  EXPECT_EQ(meter_.longest()->cpu, 2ms);
  EXPECT_EQ(meter_.longest()->queued, 5ms);
  EXPECT_EQ(meter_.longest()->blocked, 30ms);
}

TEST_F(LoopMeterTest, CountsTurnsOverTheLimitByWallAndByOwnWork) {
  for (int i = 0; i < 5; ++i)
    Turn("short", [&] { clocks_.Work(10ms); });  // the limit itself is not over it
  Turn("busy machine", [&] { clocks_.Work(1ms), clocks_.Queue(50ms); });
  Turn("long work", [&] { clocks_.Work(11ms); });
  clocks_.Work(1h);  // between turns
  EXPECT_EQ(meter_.all().count, 7);
  EXPECT_EQ(meter_.all().over_limit, 2);
  EXPECT_EQ(meter_.all().cpu_over_limit, 1);
  Turn("long work", [&] { clocks_.Work(10ms); });
  ASSERT_EQ(meter_.slow_turns().size(), 1);
  EXPECT_EQ(meter_.slow_turns().at("long work").times, 1);
  EXPECT_EQ(meter_.slow_turns().at("long work").of, 2);
  EXPECT_EQ(meter_.longest()->what, "busy machine");
  EXPECT_EQ(meter_.longest_cpu()->what, "long work");
  EXPECT_EQ(meter_.by_name().at("short").count, 5);
  EXPECT_EQ(meter_.by_name().at("short").over_limit, 0);
  EXPECT_EQ(meter_.by_name().at("busy machine").cpu_over_limit, 0);
}

TEST_F(LoopMeterTest, NamesThePartThatTookLongestAndCountsEachByItself) {
  Turn("http", [&] {
    clocks_.Work(1ms);
    meter_.Part("GET /a");
    clocks_.Work(2ms);
    meter_.Part("");
    clocks_.Work(1ms);
    meter_.Part("GET /b");
    clocks_.Work(9ms);
    meter_.Part("");
  });
  meter_.Part("outside of any turn");
  EXPECT_EQ(meter_.longest()->what, "http: GET /b");
  EXPECT_EQ(meter_.longest()->cpu, 13ms);
  EXPECT_EQ(meter_.all().cpu_over_limit, 1) << "the whole turn counts, however it is divided";
  EXPECT_EQ(meter_.slow_turns().at("http: GET /b").times, 1);
  EXPECT_EQ(meter_.slow_turns().at("http: GET /b").of, 1);
  EXPECT_EQ(meter_.by_name().at("GET /b").longest_cpu, 9ms);
  EXPECT_EQ(meter_.by_name().at("GET /a").longest_cpu, 2ms);
  EXPECT_EQ(meter_.by_name().at("http").longest_cpu, 1ms);
  EXPECT_FALSE(meter_.by_name().contains("outside of any turn"));
  Turn("tick", [&] { clocks_.Work(20ms); });
  EXPECT_EQ(meter_.longest()->what, "tick") << "no part of the turn before";
}

TEST_F(LoopMeterTest, TellsASlowTurnAtMostOnceAMinuteAndHowManyWereNotTold) {
  std::vector<std::int64_t> reported;
  meter_.SetSlowListener([&](const LoopTurn& turn, std::int64_t unsaid) {
    EXPECT_EQ(turn.what, "slow");
    reported.push_back(unsaid);
  });
  const auto slow = [&] { Turn("slow", [&] { clocks_.Block(11ms); }); };
  Turn("quick", [&] { clocks_.Block(10ms); });
  EXPECT_THAT(reported, ::testing::IsEmpty());
  for (int i = 0; i < 4; ++i) slow();
  EXPECT_THAT(reported, ::testing::ElementsAre(0));
  clocks_.wall += LoopMeter::kReportInterval;
  slow();
  slow();
  EXPECT_THAT(reported, ::testing::ElementsAre(0, 3));
}

TEST_F(LoopMeterTest, ReportsAreWhatTheStatusAndTheDiagnosticsShow) {
  EXPECT_EQ(LoopJson(meter_), nullptr) << "nothing was measured";
  Turn("tick", [&] { clocks_.Work(250us); });
  Turn("http", [&] { clocks_.Work(12ms), clocks_.Block(3ms); });
  const nlohmann::json json = LoopJson(meter_);
  EXPECT_EQ(json["turns"], 2);
  EXPECT_EQ(json["over_10_ms"], 1);
  EXPECT_EQ(json["cpu_over_10_ms"], 1);
  EXPECT_EQ(json["slow"]["http"], (nlohmann::json{{"times", 1}, {"of", 1}}));
  EXPECT_EQ(json["longest"], (nlohmann::json{{"what", "http"},
                                             {"ms", 15.0},
                                             {"cpu_ms", 12.0},
                                             {"queued_ms", 0.0},
                                             {"blocked_ms", 3.0}}));
  const std::string table = LoopTable(meter_);
  EXPECT_LT(table.find("http"), table.find("tick")) << table;
  EXPECT_THAT(table, HasSubstr("15.00"));
  EXPECT_THAT(SlowTurnText(*meter_.longest(), 3), HasSubstr("15 ms by http: 12 ms of work"));
  EXPECT_THAT(SlowTurnText(*meter_.longest(), 3), HasSubstr("3 more"));
  EXPECT_THAT(SlowTurnText(*meter_.longest(), 0), Not(HasSubstr("more")));
}

// The real clocks, on what is known to be work, waiting, and having no processor.

void Spin(std::chrono::milliseconds cpu) {
  const LoopClocks clocks = ClocksOfThisThread();
  for (const auto until = clocks.cpu() + cpu; clocks.cpu() < until;) {
  }
}

TEST(LoopMeterClocksTest, WorkIsWorkAndSleepIsNone) {
  EventLoop loop;
  loop.Post("spin", [] { Spin(30ms); });
  loop.Post("sleep", [] { ::poll(nullptr, 0, 60); });
  loop.Quit(0);
  loop.Run();
  const auto& by_name = loop.meter().by_name();
  EXPECT_GE(by_name.at("spin").longest_cpu, 30ms);
  EXPECT_GE(by_name.at("sleep").longest, 60ms);
  EXPECT_LT(by_name.at("sleep").longest_cpu, 10ms);
  EXPECT_EQ(loop.meter().all().count, 3) << "two and the one that quits";
  EXPECT_EQ(loop.meter().all().cpu_over_limit, 1);
}

TEST(LoopMeterClocksTest, SharingAProcessorIsWaitingForIt) {
  if (!std::ifstream("/proc/thread-self/schedstat").good())
    PLUMB_SKIP("this kernel does not count it");
  cpu_set_t allowed, one;
  ASSERT_EQ(pthread_getaffinity_np(pthread_self(), sizeof allowed, &allowed), 0);
  CPU_ZERO(&one);
  for (int i = 0; i < CPU_SETSIZE && CPU_COUNT(&one) == 0; ++i) {
    if (CPU_ISSET(i, &allowed)) CPU_SET(i, &one);
  }
  LoopMeter meter;
  ASSERT_EQ(pthread_setaffinity_np(pthread_self(), sizeof one, &one), 0);
  {
    std::atomic<bool> over = false;
    const std::jthread rival([&] {  // inherits the one processor
      while (!over) {
      }
    });
    meter.Begin("shared");
    Spin(200ms);
    meter.End();
    over = true;
  }
  pthread_setaffinity_np(pthread_self(), sizeof allowed, &allowed);
  const LoopTurn turn = *meter.longest();
  // Fairness gives the rival about as much as us; with others on the machine we wait longer.
  EXPECT_GE(turn.cpu, 200ms);
  EXPECT_GE(turn.queued, 50ms);
  EXPECT_GE(turn.queued, 10 * turn.blocked) << "nothing was waited for but the processor";
}

}  // namespace
}  // namespace plumb
