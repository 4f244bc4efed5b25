// The appliance on its loop, with a sensor that does what a test says.
#include "daemon/appliance/appliance.hpp"
#include "daemon/records/check_json.hpp"

#include <future>
#include <thread>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/appliance/unit_profile.hpp"
#include "daemon/appliance/web_service.hpp"
#include "daemon/records/profile_shelf.hpp"
#include "tests/support/fake_sensor.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using testing::FakeBus;
using testing::FakeProvider;

/// Its driver takes as long to open a sensor as the test wants.
class SlowProvider : public FakeProvider {
 public:
  SlowProvider(FakeBus& bus, std::shared_future<void> may_open)
      : FakeProvider(bus), may_open_(std::move(may_open)) {}
  [[nodiscard]] std::unique_ptr<LiveSensor> Open(const std::string& serial) override {
    may_open_.wait();
    return FakeProvider::Open(serial);
  }

 private:
  std::shared_future<void> may_open_;
};

/// A machine that stays on.
class FakeRestart : public SystemRestart {
 public:
  void Restart(std::function<void(const std::string&)> done) override {
    ++num_asked;
    done(failure);
  }
  int num_asked = 0;
  std::string failure;
};

web::Scan ScanOf(bool check_overdue) {
  web::Scan scan;
  scan.id = "1";
  scan.check_overdue = check_overdue;
  return scan;
}

class ApplianceTest : public ::testing::Test {
 protected:
  ApplianceTest() {
    parts_.config.appliance.state = folder_ / "state";
    parts_.config.update.folder = folder_ / "updates";
    parts_.demo_patient = "demo";
    parts_.make_provider = [this] { return std::make_unique<SlowProvider>(bus_, may_open_); };
  }

  /// Runs the test beside the loop, which has the main thread; a loop that has ended does not begin
  /// again.
  void Play(const std::function<void()>& test) {
    appliance_ = std::make_unique<Appliance>(loop_, parts_);
    auto restart = std::make_unique<FakeRestart>();
    restart_ = restart.get();
    service_ = std::make_unique<WebService>(*appliance_, parts_.config.update, std::move(restart));
    std::jthread player([&] {
      test();
      if (!opens_) LetOpen();
      loop_.Quit(0);
    });
    loop_.Run();
    service_.reset();
    appliance_.reset();
  }

  /// On the loop's thread; waits for it.
  void On(const std::function<void()>& work) {
    const auto done =
        std::make_shared<std::promise<void>>();  // shared: it wakes us while it is still at it
    loop_.Post("test", [&work, done] {
      work();
      done->set_value();
    });
    done->get_future().wait();
  }
  /// False if it does not come to that within half a minute. Asked on the loop's thread.
  [[nodiscard]] bool Becomes(const std::function<bool()>& holds) {
    const auto until = EventLoop::Clock::now() + std::chrono::seconds(30);
    while (EventLoop::Clock::now() < until) {
      bool does = false;
      On([&] { does = holds(); });
      if (does) return true;
      std::this_thread::yield();
    }
    return false;
  }
  void LetOpen() {
    opens_ = true;
    opener_.set_value();
  }
  void MakeReady() {
    LetOpen();
    bus_.Plug("A");
    bus_.GiveFrame();
    ASSERT_TRUE(Becomes([&] { return appliance_->state().phase == ScanPhase::kReady; }));
  }
  [[nodiscard]] bool IsRunning() const {
    const ScanPhase phase = appliance_->state().phase;
    return phase == ScanPhase::kScanning || phase == ScanPhase::kWorking;
  }

  EventLoop loop_;  // first: blocks signals before any thread starts
  testing::TempFolder folder_;
  FakeBus bus_;
  ApplianceParts parts_;
  std::unique_ptr<Appliance> appliance_;
  std::unique_ptr<WebService> service_;
  FakeRestart* restart_ = nullptr;
  std::promise<void> opener_;
  std::shared_future<void> may_open_ = opener_.get_future().share();
  bool opens_ = false;
};

TEST_F(ApplianceTest, AWorkerIsNotAliveWhileADriverDoesNotComeBackFromOpening) {
  parts_.sensor_silence_s = 0.7;
  Play([&] {
    bus_.Plug("A");
    EXPECT_TRUE(Becomes([&] { return !appliance_->WorkersAreAlive(); }));
    On([&] { EXPECT_FALSE(appliance_->Health().ok); });
    LetOpen();
    EXPECT_TRUE(Becomes([&] {
      bus_.GiveFrame();
      return appliance_->WorkersAreAlive();
    }));
  });
}

TEST_F(ApplianceTest, AWorkerIsNotAliveWhileAResultIsComputedWithoutProgress) {
  parts_.worker_silence_s = -1;  // any time without progress is too long
  Play([&] {
    MakeReady();
    On([&] {
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort), "");
      EXPECT_EQ(appliance_->state().phase, ScanPhase::kScanning);
      EXPECT_TRUE(appliance_->WorkersAreAlive()) << "it waits for frames";
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort), "");
      EXPECT_EQ(appliance_->state().phase, ScanPhase::kWorking);
      EXPECT_FALSE(appliance_->WorkersAreAlive());
    });
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    On([&] { EXPECT_TRUE(appliance_->WorkersAreAlive()); });
  });
}

TEST_F(ApplianceTest, APatientWhoIsWipedWhileADailyCheckIsOpenIsNotOpenAfterIt) {
  const web::Actor actor{.user = "tester", .address = {}};
  parts_.demo_patient.clear();
  Play([&] {
    MakeReady();
    std::promise<web::Change> added, wiped;
    On([&] {
      service_->AddPatient(actor, "P1", "",
                           [&](const web::Change& change) { added.set_value(change); });
    });
    const std::string id = added.get_future().get().id;
    std::promise<web::Change> opened;
    On([&] {
      (void)appliance_->store()->AddCheck(
          actor, appliance_->WebStatus().sensor.serial,
          CheckJson({.status = MarkerCheckStatus::kPassed, .items = {}, .reasons = {}}, {}));
      service_->OpenPatient(actor, id, web::ScanPurpose::kReference, "", "",
                            [&](const web::Change& change) { opened.set_value(change); });
    });
    EXPECT_EQ(opened.get_future().get().result, web::ChangeResult::kDone);
    On([&] {
      EXPECT_EQ(appliance_->WebStatus().patient_id, id);
      EXPECT_EQ(appliance_->OpenCheck(actor), "");
      service_->WipePatient(actor, id, [&](const web::Change& change) { wiped.set_value(change); });
      EXPECT_EQ(appliance_->WebStatus().next_purpose, web::ScanPurpose::kDailyCheck)
          << "the check stays open";
    });
    EXPECT_EQ(wiped.get_future().get().result, web::ChangeResult::kDone);
    On([&] {
      for (int i = 0; i < 2; ++i) EXPECT_EQ(appliance_->Press(ButtonPress::kShort), "");
    });
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    On([&] {
      EXPECT_NE(appliance_->WebStatus().next_purpose, web::ScanPurpose::kDailyCheck);
      EXPECT_EQ(appliance_->WebStatus().patient_id, "");
    });
  });
}

/// What RestartSystem() answers, on the loop.
web::Change Restarted(WebService& service) {
  web::Change answer{.result = web::ChangeResult::kFailed, .message = "none", .id = {}, .file = {}};
  service.RestartSystem({.user = "erik", .address = {}},
                        [&](const web::Change& change) { answer = change; });
  return answer;
}

TEST_F(ApplianceTest, TheMachineIsNotRestartedUnderAScan) {
  Play([&] {
    MakeReady();
    On([&] {
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort), "");
      ASSERT_EQ(appliance_->state().phase, ScanPhase::kScanning);
      EXPECT_EQ(Restarted(*service_).result, web::ChangeResult::kConflict);
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort), "");
      ASSERT_EQ(appliance_->state().phase, ScanPhase::kWorking);
      const web::Change answer = Restarted(*service_);
      EXPECT_EQ(answer.result, web::ChangeResult::kConflict);
      EXPECT_THAT(answer.message, ::testing::HasSubstr("wait for its result"));
      EXPECT_EQ(restart_->num_asked, 0);
    });
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    On([&] {
      EXPECT_EQ(Restarted(*service_).result, web::ChangeResult::kDone);
      EXPECT_EQ(restart_->num_asked, 1);
      EXPECT_THAT(appliance_->Press(ButtonPress::kShort), ::testing::HasSubstr("being restarted"));
      EXPECT_THAT(Restarted(*service_).message, ::testing::HasSubstr("being restarted"));
      EXPECT_EQ(restart_->num_asked, 1);
    });
  });
}

TEST_F(ApplianceTest, TheMachineIsNotRestartedInASessionAndAFailedRestartLeavesItUsable) {
  parts_.demo_patient.clear();
  Play([&] {
    MakeReady();
    On([&] {
      appliance_->OpenSession("1", "p", web::ScanPurpose::kReference, "",
                              {.user = "tess", .address = {}});
      const web::Change answer = Restarted(*service_);
      EXPECT_EQ(answer.result, web::ChangeResult::kConflict);
      EXPECT_THAT(answer.message, ::testing::HasSubstr("session of a patient is open"));
      EXPECT_EQ(restart_->num_asked, 0);
      EXPECT_EQ(appliance_->CloseSession({.user = "tess", .address = {}}), "");
      restart_->failure = "the machine cannot be restarted from here: no";
      const web::Change failed = Restarted(*service_);
      EXPECT_EQ(failed.result, web::ChangeResult::kFailed);
      EXPECT_EQ(failed.message, restart_->failure);
      restart_->failure.clear();
      EXPECT_EQ(Restarted(*service_).result, web::ChangeResult::kDone) << "asked again";
      EXPECT_EQ(restart_->num_asked, 2);
    });
  });
}

TEST_F(ApplianceTest, WithoutTodaysCheckNoReferenceIsScannedOrApproved) {
  parts_.demo_patient.clear();
  Play([&] {
    MakeReady();
    const web::Actor tess = {.user = "tess", .address = {}};
    web::Change answer;
    const web::Done keep = [&](const web::Change& change) { answer = change; };
    std::string patient;
    On([&] {
      patient = appliance_->store()->AddPatient(tess, "P-1", "");
      EXPECT_THAT(appliance_->WebStatus().reference_block, ::testing::HasSubstr("daily check"));
      service_->OpenPatient(tess, patient, web::ScanPurpose::kReference, "", "", keep);
      EXPECT_EQ(answer.result, web::ChangeResult::kConflict);
      EXPECT_THAT(answer.message, ::testing::HasSubstr("open Daily check"));
      service_->ApproveReference(tess, "1", 1, "", keep);
      EXPECT_THAT(answer.message, ::testing::HasSubstr("open Daily check"));
      service_->AddReference(tess, "1", "", keep);
      EXPECT_THAT(answer.message, ::testing::HasSubstr("open Daily check"));
      // A session that was open since yesterday.
      appliance_->OpenSession("1", patient, web::ScanPurpose::kReference, "", tess);
      (void)appliance_->Press(ButtonPress::kShort);
    });
    EXPECT_TRUE(Becomes([&] {
      return appliance_->WebStatus().fault.find("open Daily check") != std::string::npos;
    }));
    On([&] {
      EXPECT_TRUE(appliance_->store()->Scans("", 10).empty()) << "nothing was scanned";
      (void)appliance_->store()->AddCheck(
          tess, appliance_->WebStatus().sensor.serial,
          CheckJson({.status = MarkerCheckStatus::kPassed, .items = {}, .reasons = {}}, {}));
      EXPECT_EQ(appliance_->WebStatus().reference_block, "");
      EXPECT_EQ(appliance_->WhyNoReference(ScanOf(false)), "");
      EXPECT_THAT(appliance_->WhyNoReference(ScanOf(true)),
                  ::testing::HasSubstr("scan the reference again"))
          << "of a scan from before the check";
      (void)appliance_->CloseSession(tess);
      (void)appliance_->Press(ButtonPress::kShort);  // acknowledges the fault
      service_->OpenPatient(tess, patient, web::ScanPurpose::kReference, "", "", keep);
    });
    EXPECT_TRUE(Becomes([&] { return appliance_->WebStatus().session.has_value(); }));
  });
}

TEST_F(ApplianceTest, TheDemoNeedsNoCheckForItsReference) {
  Play([&] {
    MakeReady();
    On([&] {
      EXPECT_TRUE(appliance_->WebStatus().check_overdue);
      EXPECT_EQ(appliance_->WebStatus().reference_block, "");
      EXPECT_EQ(appliance_->WhyNoReference(ScanOf(true)), "");
    });
  });
}

TEST_F(ApplianceTest, ARollBackIsToldByStatusAndLightUntilItIsSeen) {
  Play([&] {
    MakeReady();
    On([&] {
      EXPECT_EQ(appliance_->WebStatus().light, "ready");
      appliance_->SetRolledBack("the machine has gone back");
      EXPECT_EQ(appliance_->WebStatus().light, "ready_rolled_back");
      EXPECT_EQ(appliance_->WebStatus().rolled_back, "the machine has gone back");
      EXPECT_THAT(appliance_->StatusJson(), ::testing::HasSubstr("the machine has gone back"));
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort), "") << "scans go on";
      EXPECT_EQ(appliance_->WebStatus().light, "scanning");
      EXPECT_EQ(appliance_->Cancel(), "");
    });
    EXPECT_TRUE(Becomes([&] { return appliance_->WebStatus().light == "ready_rolled_back"; }));
    On([&] {
      appliance_->SetRolledBack({});
      EXPECT_EQ(appliance_->WebStatus().light, "ready");
    });
  });
}

class ApplianceProfileTest : public ApplianceTest {
 protected:
  /// What the page's last request was answered.
  web::Change Asked(const std::function<void(web::Done)>& ask) {
    const auto answer = std::make_shared<std::promise<web::Change>>();
    On([&] { ask([answer](const web::Change& change) { answer->set_value(change); }); });
    return answer->get_future().get();
  }
  web::Change Reset(const std::string& serial) {
    return Asked([&](web::Done done) { service_->ResetSensorProfile(erik_, serial, done); });
  }
  web::Change RollBack(int version) {
    return Asked(
        [&](web::Done done) { service_->RollBackSensorProfile(erik_, "A", version, done); });
  }
  /// The profile that a scan of now begins from: read as each scan reads it, from the same shelf.
  [[nodiscard]] std::string NextScanBeginsFrom() const {
    UnitProfile unit(appliance_->profiles(), "A", FakeBus::Info().intrinsics);
    ReconstructorOptions options;
    unit.Begin(options);
    if (!options.profile) return "none";
    return fmt::format("{}, {} sweeps", options.profile->name, options.profile->num_sweeps);
  }

  const web::Actor erik_{.user = "erik", .address = {}};
};

TEST_F(ApplianceProfileTest, WhatThePageAsksIsWhatTheNextScanBeginsFrom) {
  SensorProfile known = ProfileOfAnyUnit(FakeBus::Info().intrinsics);
  ProfileShelf shelf(folder_ / "state" / "sensor-profiles");
  for (known.num_sweeps = 4; known.num_sweeps <= 5; ++known.num_sweeps) (void)shelf.Add("A", known);
  Play([&] {
    EXPECT_EQ(service_->GetSensorProfiles().why_none, "no sensor is attached");
    EXPECT_EQ(Reset("A").result, web::ChangeResult::kConflict);
    MakeReady();
    const web::SensorProfiles shown = service_->GetSensorProfiles();
    EXPECT_EQ(shown.serial, "A");
    EXPECT_EQ(shown.why_none, "");
    ASSERT_EQ(shown.versions.size(), 2U);
    EXPECT_EQ(shown.versions[0].version, 2);
    EXPECT_EQ(shown.versions[0].num_sweeps, 5);
    EXPECT_EQ(shown.versions[0].cause, "learned");
    EXPECT_EQ(NextScanBeginsFrom(), "A version 2, 5 sweeps");

    EXPECT_EQ(Reset("B").result, web::ChangeResult::kConflict) << "another unit";
    EXPECT_EQ(RollBack(7).result, web::ChangeResult::kNotFound);
    EXPECT_EQ(NextScanBeginsFrom(), "A version 2, 5 sweeps") << "refused: nothing has changed";
    EXPECT_EQ(Reset("A").result, web::ChangeResult::kDone);
    EXPECT_EQ(NextScanBeginsFrom(), "none");
    EXPECT_EQ(RollBack(1).result, web::ChangeResult::kDone);
    EXPECT_EQ(NextScanBeginsFrom(), "A version 4, 4 sweeps");
    EXPECT_FALSE(service_->SensorProfileFile(3)) << "the reset";
    EXPECT_THAT(service_->SensorProfileFile(4).value_or(""), ::testing::HasSubstr("calibration"));
  });
}

TEST_F(ApplianceProfileTest, NothingChangesUnderAScan) {
  Play([&] {
    MakeReady();
    On([&] { EXPECT_EQ(appliance_->Press(ButtonPress::kShort), ""); });
    const web::Change answer = Reset("A");
    EXPECT_EQ(answer.result, web::ChangeResult::kConflict);
    EXPECT_THAT(answer.message, ::testing::HasSubstr("wait for its result"));
    EXPECT_TRUE(service_->GetSensorProfiles().versions.empty());
    On([&] { EXPECT_EQ(appliance_->Cancel(), ""); });
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    EXPECT_EQ(Reset("A").result, web::ChangeResult::kDone);
    EXPECT_EQ(service_->GetSensorProfiles().versions.size(), 1U);
  });
}

TEST_F(ApplianceProfileTest, SwitchedOffItSaysSo) {
  parts_.config.appliance.sensor_profiles = false;
  Play([&] {
    MakeReady();
    EXPECT_THAT(service_->GetSensorProfiles().why_none, ::testing::HasSubstr("switched off"));
    EXPECT_EQ(Reset("A").result, web::ChangeResult::kConflict);
  });
}

}  // namespace
}  // namespace plumb
