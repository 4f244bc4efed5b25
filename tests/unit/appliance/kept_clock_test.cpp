// SPDX-License-Identifier: Apache-2.0
#include "daemon/storage/kept_clock.hpp"

#include <sys/timex.h>

#include <fstream>

#include <gtest/gtest.h>

#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

AskKernelClock Answers(int answer, int status) {
  return [=](timex& state) {
    EXPECT_EQ(state.modes, 0U) << "it only asks";
    state.status = status;
    return answer;
  };
}

TEST(KeptClockTest, IsWhatAnyProgramThatKeepsTheClockTellsTheKernel) {
  const testing::TempFolder folder;
  const auto note = folder / "synchronized";
  EXPECT_TRUE(IsClockKept(note, Answers(TIME_OK, STA_PLL))) << "chrony or ntpd keeps it";
  EXPECT_TRUE(IsClockKept(note, Answers(TIME_INS, STA_PLL))) << "on the day of a leap second";
  EXPECT_FALSE(IsClockKept(note, Answers(TIME_ERROR, STA_UNSYNC))) << "no program keeps it";
  EXPECT_FALSE(IsClockKept(note, Answers(TIME_OK, STA_UNSYNC | STA_PLL)));
  EXPECT_FALSE(IsClockKept(note, Answers(TIME_ERROR, 0))) << "its error is unknown";
  EXPECT_FALSE(IsClockKept(note, Answers(-1, 0))) << "a sandbox forbids asking";
}

TEST(KeptClockTest, IsWhatSystemdTimesyncdNotes) {
  const testing::TempFolder folder;
  const auto note = folder / "synchronized";
  std::ofstream(note) << "";
  EXPECT_TRUE(IsClockKept(note, Answers(TIME_ERROR, STA_UNSYNC)))
      << "its servers have been away since";
}

}  // namespace
}  // namespace plumb
