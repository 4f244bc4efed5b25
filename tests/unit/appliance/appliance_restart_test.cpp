// SPDX-License-Identifier: Apache-2.0
// When the machine may be restarted and reset to its factory state.
#include <filesystem>
#include <future>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/archive/factory_reset.hpp"
#include "tests/unit/appliance/appliance_fixture.hpp"
#include "words/upkeep.hpp"

namespace plumb {
namespace {

using ApplianceRestartTest = testing::ApplianceTest;

/// What RestartSystem() answers, on the loop.
Change Restarted(WebServices& services) {
  Change answer{
      .result = ChangeResult::kFailed, .message = Message::Verbatim("none"), .id = {}, .file = {}};
  services.updates().RestartSystem({.user = "erik", .address = {}},
                                   [&](const Change& change) { answer = change; });
  return answer;
}

/// What InstallUpdate() answers at once about a bundle that is not there, on the loop.
Change Installed(WebServices& services) {
  const auto answer = std::make_shared<Change>();  // it may also come later
  services.updates().InstallUpdate({.user = "erik", .address = {}}, "plumb-9.raucb",
                                   [answer](const Change& change) { *answer = change; });
  return *answer;
}

TEST_F(ApplianceRestartTest, TheMachineIsNotRestartedUnderAScan) {
  Play([&] {
    MakeReady();
    On([&] {
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), "");
      ASSERT_EQ(appliance_->state().phase, ApplianceState::kScanning);
      EXPECT_EQ(Restarted(*services_).result, ChangeResult::kConflict);
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), "");
      ASSERT_EQ(appliance_->state().phase, ApplianceState::kWorking);
      const Change answer = Restarted(*services_);
      EXPECT_EQ(answer.result, ChangeResult::kConflict);
      EXPECT_THAT(answer.message.English(), ::testing::HasSubstr("wait for its result"));
      EXPECT_EQ(restart_->num_asked, 0);
    });
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    On([&] {
      EXPECT_EQ(Restarted(*services_).result, ChangeResult::kDone);
      EXPECT_EQ(restart_->num_asked, 1);
      EXPECT_THAT(appliance_->Press(ButtonPress::kShort, kTester).English(),
                  ::testing::HasSubstr("being restarted"));
      EXPECT_THAT(Restarted(*services_).message.English(), ::testing::HasSubstr("being restarted"));
      EXPECT_EQ(restart_->num_asked, 1);
    });
  });
}

/// The final answer of ResetToFactory(). It writes in the background, not on the loop.
Change AskedToReset(WebServices& services, EventLoop& loop, FactoryReset kind) {
  auto answered = std::make_shared<std::promise<Change>>();
  loop.Post("test", [&services, answered, kind] {
    services.updates().ResetToFactory(
        {.user = "erik", .address = {}}, kind,
        [answered](const Change& change) { answered->set_value(change); });
  });
  return answered->get_future().get();
}

TEST_F(ApplianceRestartTest, AFactoryResetIsNotedBeforeTheMachineRestarts) {
  Play([&] {
    MakeReady();
    const auto is_noted = [&] {
      return std::filesystem::exists(folder_ / "state" / kFactoryResetFile);
    };
    On([&] { EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), ""); });
    EXPECT_EQ(AskedToReset(*services_, loop_, FactoryReset::kWipe).result, ChangeResult::kConflict)
        << "a scan runs";
    EXPECT_FALSE(is_noted());
    On([&] { EXPECT_EQ(appliance_->Cancel(kTester).English(), ""); });
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    restart_->failure = "the machine cannot be restarted from here: no";
    EXPECT_EQ(AskedToReset(*services_, loop_, FactoryReset::kWipe).message.English(),
              restart_->failure);
    EXPECT_FALSE(is_noted()) << "nothing is reset where the machine does not restart";
    restart_->failure.clear();
    EXPECT_EQ(AskedToReset(*services_, loop_, FactoryReset::kWipe).result, ChangeResult::kDone);
    EXPECT_TRUE(is_noted());
    On([&] {
      EXPECT_THAT(appliance_->Press(ButtonPress::kShort, kTester).English(),
                  ::testing::HasSubstr("being restarted"));
      const std::string patient = shared_->store->patients.Add(kTester, "P-1", "");
      Change answer;
      services_->services().patients.OpenPatient(kTester, patient, ScanPurpose::kReference, "", "",
                                                 [&](const Change& change) { answer = change; });
      EXPECT_THAT(answer.message.English(), ::testing::HasSubstr("being restarted"));
    });
  });
}

TEST_F(ApplianceRestartTest, AResetThatCannotBeTakenBackIsSaidAndThePageGoesOn) {
  Play([&] {
    MakeReady();
    restart_->failure = "the machine cannot be restarted from here: no";
    restart_->on_asked = [request = folder_ / "state" / kFactoryResetFile] {
      std::filesystem::remove(request);
      std::filesystem::create_directories(request);  // unlink() fails
    };
    const Change answer = AskedToReset(*services_, loop_, FactoryReset::kWipe);
    EXPECT_EQ(answer.result, ChangeResult::kFailed);
    EXPECT_TRUE(answer.message.Is(say::upkeep::kResetMayHappen));
    EXPECT_THAT(answer.message.English(), ::testing::StartsWith(restart_->failure));
    On([&] { EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), ""); });
  });
}

TEST_F(ApplianceRestartTest, AMachineThatDoesNotGoDownIsUsableAgainAndIsNotResetLater) {
  Play([&] {
    MakeReady();
    restart_->stays_up_after = std::chrono::milliseconds(50);
    EXPECT_EQ(AskedToReset(*services_, loop_, FactoryReset::kWipe).result, ChangeResult::kDone);
    EXPECT_TRUE(
        Becomes([&] { return !std::filesystem::exists(folder_ / "state" / kFactoryResetFile); }));
    On([&] { EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), ""); });
    EXPECT_TRUE(Becomes([&] {
      return shared_->store->audit.Find({0, 10, "system.restart_failed"}).size() == 1;
    })) << "it is written by another thread";
  });
}

TEST_F(ApplianceRestartTest, TheMachineIsNotRestartedInASessionAndAFailedRestartLeavesItUsable) {
  parts_.demo_patient.clear();
  Play([&] {
    MakeReady();
    On([&] {
      appliance_->OpenSession("1", "p", ScanPurpose::kReference, "",
                              {.user = "tess", .address = {}});
      const Change answer = Restarted(*services_);
      EXPECT_EQ(answer.result, ChangeResult::kConflict);
      EXPECT_THAT(answer.message.English(), ::testing::HasSubstr("session of a patient is open"));
      EXPECT_EQ(restart_->num_asked, 0);
      EXPECT_THAT(Installed(*services_).message.English(),
                  ::testing::HasSubstr("close it first, then install the update"));
      EXPECT_EQ(appliance_->CloseSession({.user = "tess", .address = {}}).English(), "");
      EXPECT_THAT(Installed(*services_).message.English(),
                  ::testing::Not(::testing::HasSubstr("session")));
      restart_->failure = "the machine cannot be restarted from here: no";
      const Change failed = Restarted(*services_);
      EXPECT_EQ(failed.result, ChangeResult::kFailed);
      EXPECT_EQ(failed.message.English(), restart_->failure);
      restart_->failure.clear();
      EXPECT_EQ(Restarted(*services_).result, ChangeResult::kDone) << "asked again";
      EXPECT_EQ(restart_->num_asked, 2);
    });
  });
}

}  // namespace
}  // namespace plumb
