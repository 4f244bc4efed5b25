// SPDX-License-Identifier: Apache-2.0
#include "daemon/sweep/sensor_thread.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <time.h>

#include <set>

#include "tests/support/fake_sensor.hpp"

namespace plumb {
namespace {

using testing::FakeBus;
using testing::FakeProvider;
using EventKindOfSensor = SensorEvent::Kind;
using std::chrono::milliseconds;

/// Collects the events of the sensor thread.
class Events {
 public:
  void operator()(const SensorEvent& event) {
    const std::lock_guard lock(mutex_);
    events_.push_back(event);
    changed_.notify_all();
  }
  /// Waits for the event with that number, from 0.
  SensorEvent At(std::size_t index) {
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, std::chrono::seconds(20),
                           [&] { return events_.size() > index; })) {
      ADD_FAILURE() << "no event " << index;
      return {};
    }
    return events_[index];
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<SensorEvent> events_;
};

class SensorThreadTest : public ::testing::Test {
 protected:
  void Start(SensorThreadOptions options = {}) {
    options.first_retry = milliseconds(5);
    options.last_retry = milliseconds(20);
    thread_ = std::make_unique<SensorThread>(
        [this] { return std::make_unique<FakeProvider>(bus_); }, options,
        [this](const SensorEvent& event) { events_(event); });
    EXPECT_EQ(events_.At(0).kind, EventKindOfSensor::kLost) << "nothing is attached yet";
  }

  FakeBus bus_;
  Events events_;
  std::unique_ptr<SensorThread> thread_;
};

TEST_F(SensorThreadTest, IsReadyWithTheFirstFrameAndNotBefore) {
  Start();
  bus_.Plug("A");
  while (bus_.opened() == 0) std::this_thread::yield();
  EXPECT_FALSE(thread_->snapshot().present) << "open, but it has shown nothing yet";
  bus_.GiveFrame();
  EXPECT_EQ(events_.At(1).kind, EventKindOfSensor::kReady);
  EXPECT_EQ(events_.At(1).sensor.serial, "A");
  EXPECT_TRUE(thread_->snapshot().present);
  EXPECT_EQ(thread_->latest()->index, 0);
}

TEST_F(SensorThreadTest, FramesGoToTheScanOnceItBeganAndNotAnyMoreOnceItEnded) {
  std::atomic<int> prepared = 0;
  Start({.serial = {}, .before_scan = [&] { ++prepared; }});
  bus_.Plug("A");
  bus_.GiveFrame();
  EXPECT_EQ(events_.At(1).kind, EventKindOfSensor::kReady);
  const auto feed = std::make_shared<LiveFeed>(10);
  thread_->BeginScan(feed);
  bus_.GiveFrame();  // may be on its way already: then it belongs to the time before the press
  while (bus_.flushed() == 0) std::this_thread::yield();
  EXPECT_EQ(prepared, 1);
  EXPECT_TRUE(bus_.exposure_locked());
  bus_.GiveFrame();
  bus_.GiveFrame();
  const std::int64_t first = feed->Next({})->index;
  EXPECT_GE(first, 1);
  EXPECT_EQ(feed->Next({})->index, first + 1);
  while (bus_.taken() < 4) std::this_thread::yield();
  thread_->EndScan();
  while (feed->Next({})) {
  }
  const std::int64_t pushed = feed->num_pushed();
  while (bus_.exposure_locked()) {
    bus_.GiveFrame();
    std::this_thread::yield();
  }
  EXPECT_EQ(feed->num_pushed(), pushed) << "the feed is closed";
  EXPECT_EQ(feed->TakeDropped(), 0);
}

TEST_F(SensorThreadTest, ASensorThatTheDriverDidNotReportIsFoundToo) {
  Start();
  EXPECT_EQ(events_.At(0).kind, EventKindOfSensor::kLost);
  bus_.PlugUnreported("A");
  while (bus_.opened() == 0) std::this_thread::yield();  // GiveFrame() would wake the listener
  bus_.GiveFrame();
  EXPECT_EQ(events_.At(1).kind, EventKindOfSensor::kReady);
}

TEST_F(SensorThreadTest, AnUnpluggedSensorIsLostAndAnotherOneTakesItsPlace) {
  Start();
  bus_.Plug("A");
  bus_.GiveFrame();
  EXPECT_EQ(events_.At(1).kind, EventKindOfSensor::kReady);
  bus_.Unplug();
  EXPECT_EQ(events_.At(2).kind, EventKindOfSensor::kLost);
  EXPECT_FALSE(thread_->snapshot().present);
  EXPECT_EQ(thread_->latest(), std::nullopt);
  bus_.Plug("B");
  bus_.GiveFrame();
  EXPECT_EQ(events_.At(3).kind, EventKindOfSensor::kReady);
  EXPECT_EQ(events_.At(3).sensor.serial, "B");
}

TEST_F(SensorThreadTest, AScanGetsNoFrameOfTheSensorThatComesAfterItsOwnWasUnplugged) {
  Start();
  bus_.Plug("A");
  bus_.GiveFrame();
  EXPECT_EQ(events_.At(1).kind, EventKindOfSensor::kReady);
  const auto feed = std::make_shared<LiveFeed>(10);
  thread_->BeginScan(feed);
  bus_.GiveFrame();
  while (bus_.flushed() == 0) std::this_thread::yield();
  bus_.GiveFrame();
  while (feed->num_pushed() == 0) std::this_thread::yield();
  bus_.Unplug();
  EXPECT_EQ(events_.At(2).kind, EventKindOfSensor::kLost);
  const std::int64_t pushed = feed->num_pushed();
  bus_.Plug("B");
  bus_.GiveFrame();
  EXPECT_EQ(events_.At(3).sensor.serial, "B");
  const int taken = bus_.taken();
  for (int i = 0; i < 3; ++i) bus_.GiveFrame();
  while (bus_.taken() < taken + 3) std::this_thread::yield();
  EXPECT_EQ(feed->num_pushed(), pushed) << "the scan has not been ended yet";
  const auto next = std::make_shared<LiveFeed>(10);
  thread_->BeginScan(next);
  while (next->num_pushed() == 0) bus_.GiveFrame();
}

TEST_F(SensorThreadTest, SensorsThatAreNotUsedAreToldWhenTheyComeAndNotWhileAScanRuns) {
  Start();
  bus_.Plug("A");
  bus_.GiveFrame();
  EXPECT_TRUE(events_.At(1).others.empty());
  bus_.Plug("B");
  bus_.GiveFrame();
  EXPECT_EQ(events_.At(2).kind, EventKindOfSensor::kOthers);
  EXPECT_EQ(events_.At(2).sensor.serial, "A");
  EXPECT_EQ(events_.At(2).others, std::vector<std::string>{"B"});
  thread_->BeginScan(std::make_shared<LiveFeed>(10));
  while (!bus_.exposure_locked()) bus_.GiveFrame();
  bus_.Plug("C");
  const int taken = bus_.taken();
  for (int i = 0; i < 3; ++i) bus_.GiveFrame();
  while (bus_.taken() < taken + 3) std::this_thread::yield();
  EXPECT_EQ(thread_->snapshot().others.size(), 1U);
  thread_->EndScan();
  while (thread_->snapshot().others.size() < 2) bus_.GiveFrame();
  EXPECT_EQ(events_.At(3).others, (std::vector<std::string>{"B", "C"}));
}

TEST_F(SensorThreadTest, AFailureIsToldOnceAndTriedAgain) {
  Start();
  bus_.RefuseToOpen("no permission; see plumb doctor");
  bus_.Plug("A");
  EXPECT_EQ(events_.At(1).kind, EventKindOfSensor::kFailed);
  EXPECT_EQ(events_.At(1).reason.English(), "no permission; see plumb doctor");
  bus_.GiveFrame();
  EXPECT_EQ(events_.At(2).kind, EventKindOfSensor::kReady)
      << "by itself, without anything being plugged in";
  bus_.FailOnce("no pair for 2 s");
  EXPECT_EQ(events_.At(3).reason.English(), "no pair for 2 s");
  bus_.GiveFrame();
  EXPECT_EQ(events_.At(4).kind, EventKindOfSensor::kReady);
}

TEST_F(SensorThreadTest, OnlyTheConfiguredSensorIsUsed) {
  Start({.serial = "B", .before_scan = {}});
  bus_.Plug("A");
  EXPECT_EQ(events_.At(1).kind, EventKindOfSensor::kFailed);
  EXPECT_THAT(events_.At(1).reason.English(),
              ::testing::AllOf(::testing::HasSubstr("B"), ::testing::HasSubstr("A")));
  bus_.Plug("B");
  bus_.GiveFrame();
  EXPECT_EQ(events_.At(2).sensor.serial, "B");
}

TEST_F(SensorThreadTest, ASecondSensorIsReadForFeedsOfNoSweepAlsoAfterBothWereUnplugged) {
  Start({.serial = "A", .second_serial = "B", .before_scan = {}});
  bus_.Plug("A");
  bus_.Plug("B");
  bus_.GiveFrame();
  EXPECT_EQ(events_.At(1).kind, EventKindOfSensor::kReady);
  EXPECT_TRUE(events_.At(1).others.empty()) << "the second one has its use";
  const auto sweep = std::make_shared<LiveFeed>(10);
  thread_->BeginScan(sweep);
  while (sweep->num_pushed() == 0) {
    bus_.GiveFrame();
    std::this_thread::yield();
  }
  EXPECT_EQ(bus_.opened(), 1) << "a sweep is of one sensor";
  thread_->EndScan();

  const auto feed = std::make_shared<LiveFeed>(1000);
  thread_->BeginScan(feed, /*is_sweep=*/false);
  std::int64_t taken = 0;
  const auto wait_for_both = [&] {
    for (std::set<std::size_t> seen; seen.size() < 2; std::this_thread::yield()) {
      bus_.GiveFrame();
      if (feed->num_pushed() == taken) continue;
      ++taken;
      ASSERT_TRUE(feed->Next({}));
      seen.insert(feed->taken_sensor());
    }
  };
  wait_for_both();
  EXPECT_TRUE(thread_->AwaitSecond(feed, std::chrono::seconds(20), {}));
  EXPECT_FALSE(thread_->AwaitSecond(sweep, milliseconds(1), {})) << "it was not open for a sweep";
  bus_.Unplug();
  bus_.Plug("A");
  bus_.Plug("B");
  wait_for_both();
}

TEST_F(SensorThreadTest, ALibraryThatDoesNotStartIsAFailureThatIsTriedAgain) {
  int attempts = 0;
  thread_ = std::make_unique<SensorThread>(
      [&]() -> std::unique_ptr<SensorProvider> {
        if (++attempts < 3) throw DeviceError("the library is missing");
        return std::make_unique<FakeProvider>(bus_);
      },
      SensorThreadOptions{.serial = {},
                          .before_scan = {},
                          .first_retry = milliseconds(1),
                          .last_retry = milliseconds(2)},
      [this](const SensorEvent& event) { events_(event); });
  EXPECT_EQ(events_.At(0).reason.English(), "the library is missing");
  EXPECT_EQ(events_.At(1).kind, EventKindOfSensor::kLost)
      << "and then it works, and sees no sensor";
}

TEST_F(SensorThreadTest, WaitingForALibraryThatDoesNotStartTakesNoProcessor) {
  const auto processor_s = [] {
    timespec used{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
    return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
  };
  int attempts = 0;
  double before_s = 0, waiting_s = 0;
  thread_ = std::make_unique<SensorThread>(
      [&]() -> std::unique_ptr<SensorProvider> {
        if (++attempts == 1) {
          before_s = processor_s();
          throw DeviceError("the library is missing");
        }
        waiting_s = processor_s() - before_s;
        return std::make_unique<FakeProvider>(bus_);
      },
      SensorThreadOptions{.serial = {},
                          .before_scan = {},
                          .first_retry = milliseconds(300),
                          .last_retry = milliseconds(300)},
      [this](const SensorEvent& event) { events_(event); });
  EXPECT_EQ(events_.At(1).kind, EventKindOfSensor::kLost)
      << "the second attempt works, and sees no sensor";
  EXPECT_LT(waiting_s, 0.01) << "of 0.3 s";
}

TEST_F(SensorThreadTest, EndsAtOnceWhileItWaitsForAFrame) {
  Start();
  bus_.Plug("A");
  while (bus_.opened() == 0) std::this_thread::yield();
  thread_.reset();  // would hang if the sensor were not interrupted
}

TEST_F(SensorThreadTest, AStalledProcessFailsTheScanAndKeepsTheSensor) {
  Start();
  bus_.Plug("A");
  bus_.GiveFrame();
  EXPECT_EQ(events_.At(1).kind, EventKindOfSensor::kReady);
  const auto feed = std::make_shared<LiveFeed>(10);
  thread_->BeginScan(feed);
  bus_.GiveFrame();
  while (bus_.flushed() == 0) std::this_thread::yield();
  bus_.StallOnce("not run for 3 s");
  EXPECT_EQ(events_.At(2).kind, EventKindOfSensor::kStalled);
  try {
    while (feed->Next({})) continue;
    FAIL() << "a sweep with a gap ended as a whole one";
  } catch (const DeviceError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("not run for 3 s. Scan again"));
  }
  EXPECT_FALSE(bus_.exposure_locked());
  EXPECT_TRUE(thread_->snapshot().present);
  EXPECT_EQ(bus_.opened(), 1);
  thread_->EndScan();
  const auto next = std::make_shared<LiveFeed>(10);
  thread_->BeginScan(next);
  bus_.GiveFrame();
  while (bus_.flushed() < 2) std::this_thread::yield();
  bus_.GiveFrame();
  EXPECT_TRUE(next->Next({}));
}

TEST_F(SensorThreadTest, ASensorWhoseDepthNoiseIsImpossibleIsNotUsed) {
  Start();
  bus_.StateNoise({.constant_m = 1.2});
  bus_.Plug("A");
  EXPECT_EQ(events_.At(1).kind, EventKindOfSensor::kFailed);
  EXPECT_THAT(events_.At(1).reason.English(),
              ::testing::AllOf(::testing::HasSubstr("sensor A"),
                               ::testing::HasSubstr("constant_m is 1.2, expected"),
                               ::testing::HasSubstr("correct the driver")));
  const DepthNoise possible = {.constant_m = 0.004};
  bus_.StateNoise(possible);
  bus_.GiveFrame();
  EXPECT_EQ(events_.At(2).kind, EventKindOfSensor::kReady);
  EXPECT_EQ(thread_->snapshot().info.depth_noise, possible);
}

}  // namespace
}  // namespace plumb
