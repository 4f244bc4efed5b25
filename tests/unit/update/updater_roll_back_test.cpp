// SPDX-License-Identifier: Apache-2.0
// Whether the machine kept what was installed.
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/update/updater_fixture.hpp"

namespace plumb {
namespace {

using testing::FakeRauc;
using ::testing::HasSubstr;
using testing::UpdaterTest;

/// One installs 9.0 from system A; the test then simulates a restart of the machine.
class RollBackTest : public UpdaterTest {
 protected:
  void InstallAndEnd() {
    Start();
    WaitForRauc();
    EXPECT_FALSE(StatusNow().restart_needed);
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
    rauc_->Release();
    EXPECT_TRUE(Becomes([&] { return !StatusNow().installing; }));
    EXPECT_TRUE(StatusNow().restart_needed);
    EXPECT_EQ(StatusNow().failure.English(), "");
    On([&] { updater_.reset(); });
  }
  /// After InstallAndEnd(): another attempt in the same start, which RAUC takes up and cannot
  /// finish.
  void FailToInstallAgain() {
    rauc_->fails = true;
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
    rauc_->Release();
    EXPECT_TRUE(Becomes([&] { return !StatusNow().installing; }));
    EXPECT_THAT(StatusNow().failure.English(), HasSubstr("Failed writing to the slot"));
  }
  void StartAs(const std::string& boot) {
    boot_ = boot;
    Start();
    WaitForRauc();
  }
  std::unique_ptr<FakeRauc> rauc_ = std::make_unique<FakeRauc>(bus_.address());
};

TEST_F(RollBackTest, TheSameStartStillNeedsItsRestart) {
  RunBesideLoop([&] {
    InstallAndEnd();
    StartAs("first");
    EXPECT_TRUE(StatusNow().restart_needed);
    EXPECT_EQ(StatusNow().rolled_back.English(), "");
    EXPECT_EQ(roll_backs_, "");
  });
}

/// Two unknown boots are not the same boot.
TEST_F(RollBackTest, AStartThatIsNotKnownNeedsNoRestart) {
  boot_ = "";
  RunBesideLoop([&] {
    InstallAndEnd();
    StartAs("");
    EXPECT_FALSE(StatusNow().restart_needed);
    EXPECT_EQ(StatusNow().rolled_back, Message());
  });
}

TEST_F(RollBackTest, AMachineThatStartsTheSystemBeforeSaysSoUntilSomebodyHasSeenIt) {
  RunBesideLoop([&] {
    InstallAndEnd();
    StartAs("second");
    EXPECT_FALSE(StatusNow().restart_needed);
    EXPECT_THAT(StatusNow().rolled_back.English(), HasSubstr("version 9.0 was installed, but"));
    EXPECT_THAT(StatusNow().rolled_back.English(), HasSubstr("0.1.0"));
    On([&] { EXPECT_EQ(roll_backs_, updater_->status().rolled_back.English()) << "once"; });
    On([&] { updater_.reset(); });
    StartAs("third");
    EXPECT_NE(StatusNow().rolled_back.English(), "") << "a second restart does not hide it";
    On([&] { updater_->ForgetRollBack(); });
    EXPECT_EQ(StatusNow().rolled_back.English(), "");
    On([&] { updater_.reset(); });
    StartAs("fourth");
    EXPECT_EQ(StatusNow().rolled_back.English(), "");
  });
}

TEST_F(RollBackTest, AMachineThatStartsTheNewSystemHasNothingToSay) {
  RunBesideLoop([&] {
    InstallAndEnd();
    rauc_->slot = "B";
    StartAs("second");
    EXPECT_EQ(StatusNow().slot, "B");
    EXPECT_FALSE(StatusNow().restart_needed);
    EXPECT_EQ(StatusNow().rolled_back.English(), "");
    On([&] {
      updater_->ForgetRollBack();
      updater_.reset();
    });
    rauc_->slot = "A";  // the boot counter gave up on it later
    StartAs("third");
    EXPECT_NE(StatusNow().rolled_back.English(), "");
  });
}

TEST_F(RollBackTest, AnUpdateThatAnotherOneBeganToOverwriteIsForgotten) {
  RunBesideLoop([&] {
    InstallAndEnd();
    StartAs("first");
    EXPECT_TRUE(StatusNow().restart_needed);
    FailToInstallAgain();
    EXPECT_FALSE(StatusNow().restart_needed);
    On([&] { updater_.reset(); });
    StartAs("second");
    EXPECT_EQ(StatusNow().rolled_back.English(), "");
    EXPECT_EQ(roll_backs_, "");
  });
}

TEST_F(RollBackTest, ItIsForgottenBeforeTheInstallationEnds) {
  RunBesideLoop([&] {
    InstallAndEnd();
    StartAs("first");
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "updates" / "last-update.json"));
    On([&] { updater_.reset(); });  // as a power cut would
    StartAs("second");
    EXPECT_EQ(StatusNow().rolled_back.English(), "");
  });
}

TEST_F(RollBackTest, ABundleThatIsRefusedLeavesTheUpdateBeforeItInPlace) {
  RunBesideLoop([&] {
    InstallAndEnd();
    StartAs("first");
    rauc_->refuses_signature = true;
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kInvalid);
    EXPECT_TRUE(StatusNow().restart_needed);
    On([&] { updater_.reset(); });
    StartAs("second");
    EXPECT_THAT(StatusNow().rolled_back.English(), HasSubstr("version 9.0 was installed, but"));
  });
}

TEST_F(RollBackTest, ARollBackThatNobodyHasSeenOutlivesAnotherAttempt) {
  RunBesideLoop([&] {
    InstallAndEnd();
    StartAs("second");
    FailToInstallAgain();
    EXPECT_THAT(StatusNow().rolled_back.English(), HasSubstr("version 9.0 was installed, but"));
    EXPECT_FALSE(StatusNow().restart_needed);
  });
}

}  // namespace
}  // namespace plumb
