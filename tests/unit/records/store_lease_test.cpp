// SPDX-License-Identifier: Apache-2.0
// Two programs on one state folder, where its file system grants every lock to both.
#include <sys/file.h>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/message_of.hpp"
#include "tests/unit/records/store_fixture.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::MessageOf;

class StoreLeaseTest : public testing::StoreTest {
 protected:
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  [[nodiscard]] fs::path lease() const { return state() / kLeaseFile; }
  void Write(const LeaseHolder& holder) const {
    fs::create_directories(state());
    WriteWholeFile(lease(), nlohmann::json{{"host", holder.host},
                                           {"machine", holder.machine},
                                           {"boot", holder.boot},
                                           {"process", holder.process}}
                                .dump());
  }
  [[nodiscard]] std::string WhyNot() const {
    try {
      const Store store(state(), {.lock_wait = std::chrono::milliseconds(0)});
    } catch (const DatabaseBusy& error) {
      return error.what();
    }
    return {};
  }
};

TEST_F(StoreLeaseTest, TheFolderNamesWhoUsesItWhileItIsUsed) {
  {
    const auto store = Open();
    ASSERT_TRUE(fs::exists(lease()));
    const auto json = nlohmann::json::parse(ReadTextFile(lease(), 4096));
    EXPECT_EQ(json["process"], ::getpid());
    EXPECT_NE(json["boot"], "");
    fs::remove(lease());
    store->CheckWritable();
    EXPECT_TRUE(fs::exists(lease())) << "it is renewed";
  }
  EXPECT_FALSE(fs::exists(lease()));
}

// A copy of a disk names a process that still runs on the disk it was copied from, and a power cut
// leaves the lease of an earlier start: on one machine the lock decides.
TEST_F(StoreLeaseTest, WhatThisMachineHasLeftKeepsNobodyOut) {
  LeaseHolder self = ThisProcess();
  self.process = ::getppid();
  Write(self);
  EXPECT_EQ(WhyNot(), "");
  self.boot = "another";
  Write(self);
  EXPECT_EQ(WhyNot(), "");
  WriteWholeFile(lease(), std::string_view("half of a le"));
  EXPECT_EQ(WhyNot(), "");
}

TEST_F(StoreLeaseTest, AnotherMachineIsRespectedForTenMinutes) {
  Write({.host = "bunker-2", .machine = "another", .boot = "b", .process = 77});
  const auto now = fs::file_time_type::clock::now();
  for (const std::chrono::minutes age :
       {std::chrono::minutes(0), std::chrono::minutes(9), std::chrono::minutes(-9)}) {
    fs::last_write_time(lease(), now - age);
    EXPECT_THAT(WhyNot(), AllOf(HasSubstr("bunker-2"), HasSubstr("77"))) << age.count();
  }
  fs::last_write_time(lease(), now - std::chrono::minutes(11));
  EXPECT_EQ(WhyNot(), "");
}

TEST_F(StoreLeaseTest, SharedDisksAreRefusedByName) {
  EXPECT_THAT(WhyNoPlaceForStore("/srv/plumb", 0x6969).English(),
              AllOf(HasSubstr("/srv/plumb"), HasSubstr("NFS")));
  EXPECT_THAT(WhyNoPlaceForStore("/srv/plumb", 0xFF534D42).English(), HasSubstr("CIFS"));
  for (const unsigned long own : {0xEF53UL, 0x01021994UL, 0x58465342UL, 0x9123683EUL, 0x794c7630UL})
    EXPECT_EQ(WhyNoPlaceForStore("/srv/plumb", own).English(), "") << own;
}

TEST_F(StoreLeaseTest, WhatCannotBeLockedIsRefused) {
  FolderLock lock;
  EXPECT_THAT(MessageOf<DiskRefused>([&] { lock.Take(folder_ / "nothing"); }),
              HasSubstr("cannot be locked"));
}

}  // namespace
}  // namespace plumb
