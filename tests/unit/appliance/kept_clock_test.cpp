// SPDX-License-Identifier: Apache-2.0
#include "daemon/storage/kept_clock.hpp"

#include <sys/timex.h>

#include <chrono>
#include <cstdlib>
#include <fstream>

#include <gtest/gtest.h>

#include "drivers/files/descriptor.hpp"
#include "drivers/files/unix_socket.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

/// @param timedated  What it says if it is asked.
AskClock Answers(int answer, int status, bool timedated = false) {
  return {.kernel =
              [=](timex& state) {
                EXPECT_EQ(state.modes, 0U) << "it only asks";
                state.status = status;
                return answer;
              },
          .timedated = [=] { return timedated; }};
}

TEST(KeptClockTest, IsWhatAnyProgramThatKeepsTheClockTellsTheKernel) {
  const testing::TempFolder folder;
  const auto note = folder / "synchronized";
  EXPECT_TRUE(IsClockKept(note, Answers(TIME_OK, STA_PLL))) << "chrony or ntpd keeps it";
  EXPECT_TRUE(IsClockKept(note, Answers(TIME_INS, STA_PLL))) << "on the day of a leap second";
  EXPECT_FALSE(IsClockKept(note, Answers(TIME_ERROR, STA_UNSYNC))) << "no program keeps it";
  EXPECT_FALSE(IsClockKept(note, Answers(TIME_OK, STA_UNSYNC | STA_PLL)));
  EXPECT_FALSE(IsClockKept(note, Answers(TIME_ERROR, 0))) << "its error is unknown";
  EXPECT_FALSE(IsClockKept(note, Answers(TIME_ERROR, STA_UNSYNC, true))) << "the kernel decides";
  // A sandbox forbids asking it.
  EXPECT_TRUE(IsClockKept(note, Answers(-1, 0, true)));
  EXPECT_FALSE(IsClockKept(note, Answers(-1, 0, false)));
}

TEST(KeptClockTest, IsWhatSystemdTimesyncdNotes) {
  const testing::TempFolder folder;
  const auto note = folder / "synchronized";
  std::ofstream(note) << "";
  EXPECT_TRUE(IsClockKept(note, Answers(TIME_ERROR, STA_UNSYNC)))
      << "its servers have been away since";
}

// A socket in the place of the bus that takes connections and never speaks.
TEST(KeptClockTest, ABusThatNeverSpeaksIsNotWaitedForLong) {
  const testing::TempFolder folder;
  const Descriptor listener(ListenUnix(folder / "bus"));
  constexpr const char* kAddress = "DBUS_SYSTEM_BUS_ADDRESS";
  ::setenv(kAddress, ("unix:path=" + (folder / "bus").string()).c_str(), 1);
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_FALSE(IsKeptByTimedated(std::chrono::milliseconds(100)));
  ::unsetenv(kAddress);
  // The library's own limit for the greeting is 90 s.
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(30));
}

}  // namespace
}  // namespace plumb
