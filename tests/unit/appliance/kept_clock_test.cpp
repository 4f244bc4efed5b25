// SPDX-License-Identifier: Apache-2.0
#include "daemon/storage/kept_clock.hpp"

#include <sys/timex.h>
#include <systemd/sd-bus.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "drivers/files/descriptor.hpp"
#include "drivers/files/unix_socket.hpp"
#include "tests/support/bus_service.hpp"
#include "tests/support/private_bus.hpp"
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

/// As systemd-timedated: name, path and property are its own.
class FakeTimedated {
 public:
  FakeTimedated(const std::string& address, bool is_synchronized)
      : is_synchronized_(is_synchronized),
        service_(address, {.name = "org.freedesktop.timedate1",
                           .path = "/org/freedesktop/timedate1",
                           .interface = "org.freedesktop.timedate1",
                           .table = kTable,
                           .self = this}) {}

 private:
  static int Get(sd_bus*, const char*, const char*, const char*, sd_bus_message* answer, void* self,
                 sd_bus_error*) {
    return sd_bus_message_append(answer, "b",
                                 static_cast<const FakeTimedated*>(self)->is_synchronized_ ? 1 : 0);
  }
  static inline const sd_bus_vtable kTable[] = {
      SD_BUS_VTABLE_START(0), SD_BUS_PROPERTY("NTPSynchronized", "b", &FakeTimedated::Get, 0, 0),
      SD_BUS_VTABLE_END};

  const bool is_synchronized_;
  testing::BusService service_;
};

/// The system's bus is one in the test's folder.
class TimedatedTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ::setenv(kAddress, ("unix:path=" + (folder_ / "bus").string()).c_str(), 1);
  }
  void TearDown() override { ::unsetenv(kAddress); }

  static constexpr const char* kAddress = "DBUS_SYSTEM_BUS_ADDRESS";
  const testing::TempFolder folder_;
};

TEST_F(TimedatedTest, ItsWordIsTaken) {
  const testing::PrivateBus bus(folder_.path());
  constexpr std::chrono::seconds kPatience{60};
  EXPECT_FALSE(IsKeptByTimedated(kPatience)) << "it is not there";
  for (const bool is_synchronized : {true, false}) {
    const FakeTimedated timedated(bus.address(), is_synchronized);
    EXPECT_EQ(IsKeptByTimedated(kPatience), is_synchronized);
  }
}

// A socket in the place of the bus that takes connections and never speaks.
TEST_F(TimedatedTest, ABusThatNeverSpeaksIsNotWaitedForLong) {
  const Descriptor listener(ListenUnix(folder_ / "bus"));
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_FALSE(IsKeptByTimedated(std::chrono::milliseconds(100)));
  // The library's own limit for the greeting is 90 s.
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(30));
}

}  // namespace
}  // namespace plumb
