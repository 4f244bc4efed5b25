// SPDX-License-Identifier: Apache-2.0
// The progress of an installation, and an installation without any.
#include <chrono>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/update/updater_fixture.hpp"

namespace plumb {
namespace {

using testing::FakeRauc;
using ::testing::HasSubstr;
using testing::UpdaterTest;

/// The updater's clock is the test's.
class StandstillTest : public UpdaterTest {
 protected:
  void BeginAt(FakeRauc& rauc, const char* step, int percent) {
    rauc.first_step = step;
    rauc.first_percent = percent;
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
    EXPECT_TRUE(Becomes([&] { return StatusNow().message.English() == step; }));
  }
  /// Whether it goes on although that much time has passed and been looked at.
  bool GoesOnAt(std::chrono::seconds passed) {
    passed_ = passed;
    const int before = num_looks_;
    EXPECT_TRUE(Becomes([&] { return num_looks_ >= before + 3; }));
    return StatusNow().installing;
  }
  bool EndsAt(std::chrono::seconds passed) {
    passed_ = passed;
    return Becomes([&] { return !StatusNow().installing; });
  }
};

TEST_F(StandstillTest, AStepThatDoesNotEndIsAFailureAndAnotherAttemptCanBeMade) {
  PlayWithRauc([&](FakeRauc& rauc) {
    BeginAt(rauc, "Determining slot states", 0);
    EXPECT_TRUE(GoesOnAt(kLongestOtherStep - std::chrono::seconds(1)));
    EXPECT_TRUE(EndsAt(kLongestOtherStep));
    EXPECT_THAT(StatusNow().message.English(),
                HasSubstr("no progress for 5 minutes, at 0 % of 'Determining"));
    EXPECT_EQ(Ended(), "plumb-9.0.raucb: " + StatusNow().failure.English());
    EXPECT_FALSE(StatusNow().restart_needed);
    BeginAt(rauc, "Copying image to rootfs.1", 40);
    rauc.Release();
    EXPECT_TRUE(Becomes([&] { return StatusNow().restart_needed; }));
    EXPECT_EQ(Ended(), "plumb-9.0.raucb: ");
  });
}

TEST_F(StandstillTest, ACopyHasLongerAndProgressBeginsTheTimeAnew) {
  PlayWithRauc([&](FakeRauc& rauc) {
    BeginAt(rauc, "Copying image to rootfs.1", 40);
    const std::chrono::seconds first = kLongestCopy - std::chrono::seconds(1);
    EXPECT_TRUE(GoesOnAt(first));
    rauc.Reach(60);
    EXPECT_TRUE(Becomes([&] { return StatusNow().fraction == 0.6; }));
    EXPECT_TRUE(GoesOnAt(first + first));
    EXPECT_TRUE(EndsAt(first + kLongestCopy));
    EXPECT_THAT(StatusNow().failure.English(),
                HasSubstr("no progress for 30 minutes, at 60 % of 'Copying"));
  });
}

TEST_F(StandstillTest, CheckingTheBundleIsNoProgressOfItsInstallation) {
  PlayWithRauc([&](FakeRauc& rauc) {
    BeginAt(rauc, "Checking bundle done.", 100);
    EXPECT_EQ(StatusNow().fraction, 0.0);
    rauc.Reach(20);
    EXPECT_TRUE(Becomes([&] { return StatusNow().fraction == 0.2; }));
    rauc.Reach(100);
    EXPECT_TRUE(Becomes([&] { return StatusNow().fraction == 1.0; }));
    EXPECT_TRUE(StatusNow().installing) << "RAUC has not reported its end";
  });
}

TEST_F(StandstillTest, AnInstallationThatEndsAfterItWasGivenUpIsStillTold) {
  PlayWithRauc([&](FakeRauc& rauc) {
    BeginAt(rauc, "Copying image to rootfs.1", 40);
    EXPECT_TRUE(EndsAt(kLongestCopy));
    EXPECT_FALSE(StatusNow().restart_needed);
    rauc.Release();
    EXPECT_TRUE(Becomes([&] { return StatusNow().restart_needed; }))
        << "the next start is one of the new system";
    EXPECT_EQ(StatusNow().failure.English(), "");
  });
}

}  // namespace
}  // namespace plumb
