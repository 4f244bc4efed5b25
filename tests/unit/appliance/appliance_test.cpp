// The appliance on its loop, with a sensor that does what a test says.
#include "daemon/appliance/appliance.hpp"
#include "daemon/records/check_json.hpp"

#include <future>
#include <thread>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "daemon/appliance/unit_profile.hpp"
#include "daemon/appliance/web_services.hpp"
#include "daemon/records/factory_reset.hpp"
#include "daemon/records/profile_shelf.hpp"
#include "tests/support/board_checks.hpp"
#include "tests/support/fake_sensor.hpp"
#include "tests/support/temp_folder.hpp"
#include "web/api/json.hpp"

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
    services_ =
        std::make_unique<WebServices>(*appliance_, parts_.config.update, std::move(restart));
    std::jthread player([&] {
      test();
      if (!opens_) LetOpen();
      loop_.Quit(0);
    });
    loop_.Run();
    services_.reset();
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
  std::unique_ptr<WebServices> services_;
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
  parts_.config.appliance.warm_up_min = 0;
  Play([&] {
    MakeReady();
    std::promise<web::Change> added, wiped;
    On([&] {
      services_->services().patients.AddPatient(
          actor, "P1", "", [&](const web::Change& change) { added.set_value(change); });
    });
    const std::string id = added.get_future().get().id;
    std::promise<web::Change> opened;
    On([&] {
      (void)appliance_->store()->checks.Add(
          actor, appliance_->WebStatus().sensor.serial,
          TakenCheck{{.status = MarkerCheckStatus::kPassed, .items = {}, .reasons = {}}});
      services_->services().patients.OpenPatient(
          actor, id, web::ScanPurpose::kReference, "", "",
          [&](const web::Change& change) { opened.set_value(change); });
    });
    EXPECT_EQ(opened.get_future().get().result, web::ChangeResult::kDone);
    On([&] {
      EXPECT_EQ(appliance_->WebStatus().patient_id, id);
      EXPECT_EQ(appliance_->OpenCheck(actor), "");
      services_->services().patients.WipePatient(
          actor, id, [&](const web::Change& change) { wiped.set_value(change); });
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
web::Change Restarted(WebServices& services) {
  web::Change answer{.result = web::ChangeResult::kFailed, .message = "none", .id = {}, .file = {}};
  services.updates().RestartSystem({.user = "erik", .address = {}},
                                   [&](const web::Change& change) { answer = change; });
  return answer;
}

TEST_F(ApplianceTest, TheMachineIsNotRestartedUnderAScan) {
  Play([&] {
    MakeReady();
    On([&] {
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort), "");
      ASSERT_EQ(appliance_->state().phase, ScanPhase::kScanning);
      EXPECT_EQ(Restarted(*services_).result, web::ChangeResult::kConflict);
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort), "");
      ASSERT_EQ(appliance_->state().phase, ScanPhase::kWorking);
      const web::Change answer = Restarted(*services_);
      EXPECT_EQ(answer.result, web::ChangeResult::kConflict);
      EXPECT_THAT(answer.message, ::testing::HasSubstr("wait for its result"));
      EXPECT_EQ(restart_->num_asked, 0);
    });
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    On([&] {
      EXPECT_EQ(Restarted(*services_).result, web::ChangeResult::kDone);
      EXPECT_EQ(restart_->num_asked, 1);
      EXPECT_THAT(appliance_->Press(ButtonPress::kShort), ::testing::HasSubstr("being restarted"));
      EXPECT_THAT(Restarted(*services_).message, ::testing::HasSubstr("being restarted"));
      EXPECT_EQ(restart_->num_asked, 1);
    });
  });
}

/// The final answer of ResetToFactory(). It writes in the background, not on the loop.
web::Change AskedToReset(WebServices& services, EventLoop& loop, web::FactoryReset kind) {
  auto answered = std::make_shared<std::promise<web::Change>>();
  loop.Post("test", [&services, answered, kind] {
    services.updates().ResetToFactory(
        {.user = "erik", .address = {}}, kind,
        [answered](const web::Change& change) { answered->set_value(change); });
  });
  return answered->get_future().get();
}

TEST_F(ApplianceTest, AFactoryResetIsNotedBeforeTheMachineRestarts) {
  Play([&] {
    MakeReady();
    const auto is_noted = [&] {
      return std::filesystem::exists(folder_ / "state" / kFactoryResetFile);
    };
    On([&] { EXPECT_EQ(appliance_->Press(ButtonPress::kShort), ""); });
    EXPECT_EQ(AskedToReset(*services_, loop_, web::FactoryReset::kWipe).result,
              web::ChangeResult::kConflict)
        << "a scan runs";
    EXPECT_FALSE(is_noted());
    On([&] { EXPECT_EQ(appliance_->Cancel(), ""); });
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    restart_->failure = "the machine cannot be restarted from here: no";
    EXPECT_EQ(AskedToReset(*services_, loop_, web::FactoryReset::kWipe).message, restart_->failure);
    EXPECT_FALSE(is_noted()) << "nothing is reset where the machine does not restart";
    restart_->failure.clear();
    EXPECT_EQ(AskedToReset(*services_, loop_, web::FactoryReset::kWipe).result,
              web::ChangeResult::kDone);
    EXPECT_TRUE(is_noted());
    On([&] {
      EXPECT_THAT(appliance_->Press(ButtonPress::kShort), ::testing::HasSubstr("being restarted"));
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
      const web::Change answer = Restarted(*services_);
      EXPECT_EQ(answer.result, web::ChangeResult::kConflict);
      EXPECT_THAT(answer.message, ::testing::HasSubstr("session of a patient is open"));
      EXPECT_EQ(restart_->num_asked, 0);
      EXPECT_EQ(appliance_->CloseSession({.user = "tess", .address = {}}), "");
      restart_->failure = "the machine cannot be restarted from here: no";
      const web::Change failed = Restarted(*services_);
      EXPECT_EQ(failed.result, web::ChangeResult::kFailed);
      EXPECT_EQ(failed.message, restart_->failure);
      restart_->failure.clear();
      EXPECT_EQ(Restarted(*services_).result, web::ChangeResult::kDone) << "asked again";
      EXPECT_EQ(restart_->num_asked, 2);
    });
  });
}

TEST_F(ApplianceTest, WithoutTodaysCheckNoReferenceIsScannedOrApproved) {
  parts_.demo_patient.clear();
  parts_.config.appliance.warm_up_min = 0;
  Play([&] {
    MakeReady();
    const web::Actor tess = {.user = "tess", .address = {}};
    web::Change answer;
    const web::Done keep = [&](const web::Change& change) { answer = change; };
    std::string patient;
    On([&] {
      patient = appliance_->store()->patients.Add(tess, "P-1", "");
      EXPECT_THAT(appliance_->WebStatus().reference_block, ::testing::HasSubstr("daily check"));
      services_->services().patients.OpenPatient(tess, patient, web::ScanPurpose::kReference, "",
                                                 "", keep);
      EXPECT_EQ(answer.result, web::ChangeResult::kConflict);
      EXPECT_THAT(answer.message, ::testing::HasSubstr("open Daily check"));
      services_->services().references.ApproveReference(tess, "1", 1, "", keep);
      EXPECT_THAT(answer.message, ::testing::HasSubstr("open Daily check"));
      services_->services().references.AddReference(tess, "1", "", keep);
      EXPECT_THAT(answer.message, ::testing::HasSubstr("open Daily check"));
      // A session that was open since yesterday.
      appliance_->OpenSession("1", patient, web::ScanPurpose::kReference, "", tess);
      (void)appliance_->Press(ButtonPress::kShort);
    });
    EXPECT_TRUE(Becomes([&] {
      return appliance_->WebStatus().fault.find("open Daily check") != std::string::npos;
    }));
    On([&] {
      EXPECT_TRUE(appliance_->store()->scans.List("", 10).empty()) << "nothing was scanned";
      (void)appliance_->store()->checks.Add(
          tess, appliance_->WebStatus().sensor.serial,
          TakenCheck{{.status = MarkerCheckStatus::kPassed, .items = {}, .reasons = {}}});
      EXPECT_EQ(appliance_->WebStatus().reference_block, "");
      EXPECT_EQ(appliance_->WhyNoReference(ScanOf(false)), "");
      EXPECT_THAT(appliance_->WhyNoReference(ScanOf(true)),
                  ::testing::HasSubstr("scan the reference again"))
          << "of a scan from before the check";
      (void)appliance_->CloseSession(tess);
      (void)appliance_->Press(ButtonPress::kShort);  // acknowledges the fault
      services_->services().patients.OpenPatient(tess, patient, web::ScanPurpose::kReference, "",
                                                 "", keep);
    });
    EXPECT_TRUE(Becomes([&] { return appliance_->WebStatus().session.has_value(); }));
  });
}

TEST_F(ApplianceTest, ASessionWithoutScansClosesByItself) {
  parts_.demo_patient.clear();
  parts_.config.appliance.session_idle_min = 0.3 / 60;
  Play([&] {
    MakeReady();
    const web::Actor tess = {.user = "tess", .address = {}};
    On([&] {
      const std::string patient = appliance_->store()->patients.Add(tess, "P-1", "");
      const std::string session =
          appliance_->store()->treatments.Open(tess, patient, web::ScanPurpose::kReference);
      appliance_->OpenSession(session, patient, web::ScanPurpose::kReference, "", tess);
      EXPECT_TRUE(appliance_->WebStatus().session.has_value());
    });
    EXPECT_TRUE(Becomes([&] { return !appliance_->WebStatus().session.has_value(); }));
    EXPECT_TRUE(Becomes([&] { return !appliance_->store()->treatments.Opened().has_value(); }));
  });
}

TEST_F(ApplianceTest, AColdSensorTakesNoReference) {
  parts_.demo_patient.clear();
  ASSERT_EQ(parts_.config.appliance.warm_up_min, 15);
  Play([&] {
    MakeReady();
    On([&] {
      (void)appliance_->store()->checks.Add(
          {.user = "tess", .address = {}}, appliance_->WebStatus().sensor.serial,
          {.check = {.status = MarkerCheckStatus::kPassed, .items = {}, .reasons = {}}});
      EXPECT_THAT(appliance_->WebStatus().reference_block,
                  ::testing::HasSubstr("the sensor is still warming up"));
      EXPECT_THAT(appliance_->WebStatus().reference_block, ::testing::HasSubstr("15 min"));
      // What was scanned long ago is judged by how warm the sensor was then.
      web::Scan scan = ScanOf(false);
      scan.sensor_on_s = 899;
      EXPECT_THAT(appliance_->WhyNoReference(scan),
                  ::testing::HasSubstr("scan the reference again"));
      scan.sensor_on_s = 900;
      EXPECT_EQ(appliance_->WhyNoReference(scan), "");
      scan.sensor_on_s.reset();
      EXPECT_EQ(appliance_->WhyNoReference(scan), "") << "not known: from an older version";
    });
  });
}

TEST_F(ApplianceTest, TheConfiguredWarmUpIsInThePagesStatus) {
  parts_.demo_patient.clear();
  const auto configure = [&](const std::string& text) {
    parts_.config.appliance.warm_up_min = ParseConfig(text, "test.toml").appliance.warm_up_min;
  };
  configure("[appliance]\nwarm_up_min = 20\n");
  Play([&] {
    MakeReady();
    const auto shown_s = [&] {
      return web::ToJson(appliance_->WebStatus(), web::WallClock::now())["sensor"]["warm_up_s"];
    };
    On([&] {
      EXPECT_EQ(shown_s(), 1200);
      configure("[appliance]\nwarm_up_min = 7.5\n");
      appliance_->Reload(parts_.config);
      EXPECT_EQ(shown_s(), 450) << "read again";
    });
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
      EXPECT_THAT(appliance_->StatusJson().dump(),
                  ::testing::HasSubstr("the machine has gone back"));
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
    return Asked([&](web::Done done) {
      services_->services().profiles.ResetSensorProfile(erik_, serial, done);
    });
  }
  web::Change RollBack(int version) {
    return Asked([&](web::Done done) {
      services_->services().profiles.RollBackSensorProfile(erik_, "A", version, done);
    });
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
    EXPECT_EQ(services_->services().profiles.GetSensorProfiles().why_none, "no sensor is attached");
    EXPECT_EQ(Reset("A").result, web::ChangeResult::kConflict);
    MakeReady();
    const web::SensorProfiles shown = services_->services().profiles.GetSensorProfiles();
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
    EXPECT_FALSE(services_->services().profiles.SensorProfileFile(3)) << "the reset";
    EXPECT_THAT(services_->services().profiles.SensorProfileFile(4).value_or(""),
                ::testing::HasSubstr("calibration"));
  });
}

TEST_F(ApplianceProfileTest, NothingChangesUnderAScan) {
  Play([&] {
    MakeReady();
    On([&] { EXPECT_EQ(appliance_->Press(ButtonPress::kShort), ""); });
    const web::Change answer = Reset("A");
    EXPECT_EQ(answer.result, web::ChangeResult::kConflict);
    EXPECT_THAT(answer.message, ::testing::HasSubstr("wait for its result"));
    EXPECT_TRUE(services_->services().profiles.GetSensorProfiles().versions.empty());
    On([&] { EXPECT_EQ(appliance_->Cancel(), ""); });
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    EXPECT_EQ(Reset("A").result, web::ChangeResult::kDone);
    EXPECT_EQ(services_->services().profiles.GetSensorProfiles().versions.size(), 1U);
  });
}

TEST_F(ApplianceProfileTest, SwitchedOffItSaysSo) {
  parts_.config.appliance.sensor_profiles = false;
  Play([&] {
    MakeReady();
    EXPECT_THAT(services_->services().profiles.GetSensorProfiles().why_none,
                ::testing::HasSubstr("switched off"));
    EXPECT_EQ(Reset("A").result, web::ChangeResult::kConflict);
  });
}

class ApplianceRoomTest : public ApplianceProfileTest {
 protected:
  void ScanBoard() {
    On([&] { (void)appliance_->store()->checks.Add(erik_, "A", testing::CheckOver()); });
  }
  web::ChangeResult Sign() {
    const std::string digest = services_->services().room.GetRoomCalibration().digest;
    return Asked([&](web::Done done) {
             services_->services().room.SignRoomCalibration(erik_, digest, done);
           })
        .result;
  }
  /// Where the gantry is on a map, as reported to the page; empty when it is not known.
  std::optional<Eigen::Vector2d> Gantry() {
    std::optional<Eigen::Vector2d> gantry;
    On([&] {
      const web::Status status = appliance_->WebStatus();
      if (status.is_room_known) gantry = Eigen::Vector2d(status.gantry_xy.data());
      warnings_ = fmt::format("{}", fmt::join(status.warnings, "; "));
    });
    return gantry;
  }
  std::string warnings_;
};

TEST_F(ApplianceRoomTest, ASignedCalibrationHoldsInPlaceOfTheConfigurationUntilAMarkerMoves) {
  const Eigen::Vector2d configured(0, 1);
  const Eigen::Vector2d calibrated =
      testing::SceneFromRoom().inverse().linear().block<1, 2>(1, 0).transpose();
  parts_.config.compare.T_iec_reference = Pose::Identity();
  Play([&] {
    MakeReady();
    EXPECT_EQ(Gantry(), configured);
    EXPECT_TRUE(services_->services().room.GetRoomCalibration().is_configured);
    for (int i = 0; i < 3; ++i) {
      EXPECT_NE(Sign(), web::ChangeResult::kDone) << i << " scans";
      ScanBoard();
    }
    EXPECT_EQ(Gantry(), configured) << "not signed yet";
    EXPECT_EQ(Sign(), web::ChangeResult::kDone);
    ASSERT_TRUE(Gantry());
    EXPECT_LT((*Gantry() - calibrated).norm(), 1e-6);
    EXPECT_THAT(warnings_,
                ::testing::HasSubstr("T_iec_reference of the configuration is not used"));

    MarkerMap moved = testing::MarkersOfRoom();
    for (Eigen::Vector3d& corner : moved.at(4).corners) corner.x() += 0.008;
    On([&] {
      (void)appliance_->store()->checks.Add(erik_, "A", testing::CheckOver(0, 0, moved));
      appliance_->RefreshRoom();
    });
    EXPECT_FALSE(Gantry()) << "neither the calibration nor the configuration";
    EXPECT_THAT(warnings_, ::testing::HasSubstr("marker 4 moved 8 mm"));
    EXPECT_THAT(services_->services().room.GetRoomCalibration().due,
                ::testing::HasSubstr("marker 4"));
    for (int i = 0; i < 3; ++i) ScanBoard();
    EXPECT_EQ(Sign(), web::ChangeResult::kDone);
    EXPECT_TRUE(Gantry());
    EXPECT_EQ(services_->services().room.GetRoomCalibration().versions.front().version, 2);
  });
}

TEST_F(ApplianceRoomTest, WithoutAnyNobodyKnowsTheRoom) {
  Play([&] {
    MakeReady();
    EXPECT_FALSE(Gantry());
    EXPECT_EQ(warnings_, "");
    std::string why_not;
    EXPECT_EQ(services_->services().room.RoomBoardPdf(why_not).value_or("").substr(0, 5), "%PDF-")
        << why_not;
  });
}

}  // namespace
}  // namespace plumb
