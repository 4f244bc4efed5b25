// SPDX-License-Identifier: Apache-2.0
// What an appliance says and refuses when its disk is nearly full.
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/unit/appliance/appliance_fixture.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// An appliance whose disk has the room that a test says.
class ApplianceSpaceTest : public testing::ApplianceTest {
 protected:
  ApplianceSpaceTest() {
    parts_.demo_patient.clear();
    parts_.storage.space = [this](const fs::path&, std::error_code&) {
      const std::lock_guard lock(mutex_);
      return space_;
    };
    SetAvailable(90'000'000'000);
  }
  /// Of a disk of 100 GB, of which 5 are kept for root.
  void SetUsed(std::uintmax_t used_mb) {
    Set({.capacity = 100'000'000'000,
         .free = 100'000'000'000 - used_mb * 1'000'000,
         .available = 95'000'000'000 - used_mb * 1'000'000});
  }
  void SetAvailable(std::uintmax_t bytes) {
    Set({.capacity = 100'000'000'000, .free = bytes, .available = bytes});
  }
  [[nodiscard]] bool IsLit(const std::string& light) {
    return Becomes([&] { return appliance_->WebStatus().light == light; });
  }

 private:
  void Set(const fs::space_info& space) {
    const std::lock_guard lock(mutex_);
    space_ = space;
  }

  std::mutex mutex_;  ///< The loop and the store's thread ask for it.
  fs::space_info space_ = {};
};

TEST_F(ApplianceSpaceTest, FourFifthsOfTheDiskAreToldByPageStatusAndLight) {
  const auto warns = [&] {
    const std::vector<std::string> warnings =
        EnglishTexts(appliance_->WebStatus().storage.warnings);
    return std::find(warnings.begin(), warnings.end(),
                     "The disk is 80 % full: back up and remove scans.") != warnings.end();
  };
  Play([&] {
    SetUsed(75'999);
    MakeReady();
    EXPECT_TRUE(IsLit("ready"));
    On([&] { EXPECT_FALSE(warns()); });
    SetUsed(76'000);  // of the 95 that are not kept
    EXPECT_TRUE(IsLit("ready_disk_nearly_full"));
    On([&] {
      EXPECT_TRUE(warns());
      EXPECT_EQ(appliance_->StatusJson()["light"], "ready_disk_nearly_full");
      EXPECT_THAT(appliance_->StatusJson()["warnings"].dump(), HasSubstr("80 % full"));
      EXPECT_EQ(appliance_->state().phase, ApplianceState::kReady);
      EXPECT_TRUE(appliance_->health().ok);
    });
    SetUsed(75'999);
    EXPECT_TRUE(IsLit("ready")) << "and that it is over";
  });
}

/// Of the fake sensor, whose images are smaller than the smallest that are reckoned with.
constexpr std::uintmax_t kScanBytes = 16'000'000 + 110 * 320 * 240;
constexpr std::uintmax_t kRecordingBytes = std::uintmax_t{60 * 30 * 320 * 240} / 10 * 26;

TEST_F(ApplianceSpaceTest, OneByteTooLittleIsAFaultAndNoReadiness) {
  Play([&] {
    MakeReady();
    SetAvailable(kScanBytes);
    EXPECT_TRUE(IsLit("ready_disk_nearly_full"));
    SetAvailable(kScanBytes - 1);
    EXPECT_TRUE(IsLit("fault"));
    On([&] {
      EXPECT_EQ(appliance_->WebStatus().state, ApplianceState::kFault);
      EXPECT_EQ(appliance_->WebStatus().fault_kind, FaultKind::kStorage);
      EXPECT_THAT(appliance_->WebStatus().fault.English(),
                  HasSubstr("the disk is full: 24 MB are free"));
      EXPECT_THAT(appliance_->StatusLine(), HasSubstr("the disk is full"));
      EXPECT_THAT(appliance_->Press(ButtonPress::kShort, kTester).English(),
                  HasSubstr("the disk is full"));
      EXPECT_EQ(shared_->storage.fault().English(), "") << "scans can be removed";
      EXPECT_NE(shared_->store->patients.Add(kTester, "A", ""), "");
    });
    SetAvailable(kScanBytes);
    EXPECT_TRUE(IsLit("ready_disk_nearly_full"));
    On([&] { EXPECT_EQ(appliance_->WebStatus().fault.English(), ""); });
  });
}

TEST_F(ApplianceSpaceTest, ARecordingNeedsItsOwnRoomAndADailyCheckHasNone) {
  Settings settings;
  settings.keep_recordings = true;
  settings.scan_limit_s = 60;
  Play([&] {
    MakeReady();
    On([&] { shared_->store->settings.Change(kTester, settings); });
    const auto reason = [&] { return appliance_->health().reason.English(); };
    SetAvailable(kScanBytes + kRecordingBytes);
    On([&] { EXPECT_EQ(reason(), ""); });
    SetAvailable(kScanBytes + kRecordingBytes - 1);
    On([&] {
      EXPECT_THAT(reason(), HasSubstr("the disk is full"));
      EXPECT_EQ(appliance_->PrepareCheck(/*opens=*/true, kTester).English(), "");
      EXPECT_EQ(reason(), "");
    });
    SetAvailable(kScanBytes);
    On([&] { EXPECT_EQ(reason(), ""); });
    SetAvailable(kScanBytes - 1);
    On([&] { EXPECT_THAT(reason(), HasSubstr("the disk is full")); });
  });
}

}  // namespace
}  // namespace plumb
