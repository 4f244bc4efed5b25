#include "drivers/openni/frame_box.hpp"

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

}  // namespace
}  // namespace plumb
