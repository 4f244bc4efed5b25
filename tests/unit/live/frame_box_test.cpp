// SPDX-License-Identifier: Apache-2.0
#include "drivers/live/frame_box.hpp"

#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "algo/base/errors.hpp"

namespace plumb {
namespace {

using std::chrono::milliseconds;

// A unit on a slow bus takes longer to open than its images may stay away: the time counts from its
// start, not from the box's making.
TEST(FrameBoxTest, ImagesAreMissedOnlyAfterTheStreamsStarted) {
  constexpr milliseconds kStallTime{50};
  FrameBox box("X", milliseconds(20), kStallTime);
  EXPECT_THROW((void)box.Take(), DeviceError) << "opening takes that long";
  const FrameBox::Clock::time_point start = FrameBox::Clock::now();
  box.Begin(0);
  EXPECT_THROW((void)box.Take(), DeviceError);
  EXPECT_GE(FrameBox::Clock::now() - start, kStallTime);
}

TEST(FrameBoxTest, TheFirstPairsAreThrownAway) {
  FrameBox box("X", milliseconds(20), std::chrono::seconds(10));
  box.Begin(2);
  for (const std::int64_t stamp_us : {0, 33'000, 66'000}) {
    box.Add(StreamKind::kDepth, stamp_us, {});
    box.Add(StreamKind::kColor, stamp_us, {});
  }
  EXPECT_EQ(box.Take()->images.depth_us, 66'000);
}

// To Take(), a stop of the whole process looks as if it was not called: nothing was read, and the
// frames of that time are no evidence against the sensor.
TEST(FrameBoxTest, AStoppedProcessDoesNotBlameTheSensor) {
  constexpr milliseconds kStallTime{300};
  FrameBox box("X", milliseconds(20), kStallTime);
  box.Begin(0);
  const auto give = [&box](std::int64_t stamp_us) {
    box.Add(StreamKind::kDepth, stamp_us, {});
    box.Add(StreamKind::kColor, stamp_us, {});
  };
  std::this_thread::sleep_for(kStallTime + milliseconds(150));  // the time itself is tested
  give(0);
  EXPECT_THROW((void)box.Take(), ProcessStalled) << "though a pair is there: there is a gap";
  EXPECT_TRUE(box.Take()) << "it goes on";
  // From then on the sensor has its whole time again.
  const FrameBox::Clock::time_point start = FrameBox::Clock::now();
  try {
    (void)box.Take();
    FAIL() << "no pair came";
  } catch (const ProcessStalled&) {
    FAIL() << "it listened all the time";
  } catch (const DeviceError& error) {
    EXPECT_NE(std::string(error.what()).find("unplug it"), std::string::npos);
  }
  EXPECT_GE(FrameBox::Clock::now() - start, kStallTime - milliseconds(100));
}

TEST(FrameBoxTest, WhoWasBusyWhilePairsCameHasMissedThem) {
  constexpr milliseconds kStallTime{500};
  FrameBox box("X", milliseconds(20), kStallTime);
  box.Begin(0);
  const FrameBox::Clock::time_point start = FrameBox::Clock::now();
  for (std::int64_t i = 0; FrameBox::Clock::now() - start < 2 * kStallTime; ++i) {
    box.Add(StreamKind::kDepth, 33'000 * i, {});
    box.Add(StreamKind::kColor, 33'000 * i, {});
    std::this_thread::sleep_for(milliseconds(10));  // the time between pairs is tested
  }
  EXPECT_TRUE(box.Take()) << "the process ran all the time, but Take() was not called";
  EXPECT_GT(box.statistics().num_lost, 0);
}

TEST(FrameBoxTest, AShortAbsenceIsNone) {
  FrameBox box("X", milliseconds(20), milliseconds(2000));
  box.Begin(0);
  std::this_thread::sleep_for(milliseconds(300));  // the time itself is tested
  box.Add(StreamKind::kDepth, 0, {});
  box.Add(StreamKind::kColor, 0, {});
  EXPECT_TRUE(box.Take());
}

}  // namespace
}  // namespace plumb
