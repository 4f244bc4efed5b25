// SPDX-License-Identifier: Apache-2.0
// Sessions of patients, and the references and daily checks that scans in them need.
#include <filesystem>
#include <functional>
#include <future>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "daemon/records/check_json.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/unit/appliance/appliance_fixture.hpp"
#include "tests/unit/records/scan_folder.hpp"
#include "web/exchange/json.hpp"
#include "words/scan.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

using testing::ApplianceTest;

Scan ScanOf(DailyCheck check) {
  Scan scan;
  scan.id = "1";
  scan.daily_check = check;
  return scan;
}

struct Approved {
  std::string patient, scan;
};

/// A patient with an approved reference, and the scan that it was made of.
Approved AddApproved(Store& store, const Actor& actor) {
  const std::string patient = store.patients.Add(actor, "P-1", "");
  const std::string scan = testing::StoreScan(store, patient);
  (void)testing::PlanAndApprove(store, store.references.Add(testing::kAnna, scan, "", {}));
  return {patient, scan};
}

void OpenForFraction(Appliance& appliance, const CurrentStore& store, const std::string& patient,
                     const Actor& actor) {
  appliance.OpenSession(store->treatments.Open(actor, patient, ScanPurpose::kFraction), patient,
                        ScanPurpose::kFraction, "", actor);
}

TEST_F(ApplianceTest, APatientWhoIsWipedWhileADailyCheckIsOpenIsNotOpenAfterIt) {
  const Actor actor{.user = "tester", .address = {}};
  parts_.demo_patient.clear();
  parts_.config.appliance.warm_up_min = 0;
  Play([&] {
    MakeReady();
    std::promise<Change> added, wiped;
    On([&] {
      services_->services().patients.AddPatient(
          actor, "P1", "", [&](const Change& change) { added.set_value(change); });
    });
    const std::string id = added.get_future().get().id;
    std::promise<Change> opened;
    On([&] {
      AddPassedCheck(actor);
      services_->services().patients.OpenPatient(
          actor, id, ScanPurpose::kReference, "", "",
          [&](const Change& change) { opened.set_value(change); });
    });
    EXPECT_EQ(opened.get_future().get().result, ChangeResult::kDone);
    On([&] {
      EXPECT_EQ(appliance_->WebStatus().patient_id, id);
      EXPECT_EQ(appliance_->PrepareCheck(/*opens=*/true, actor).English(), "");
      services_->services().patients.WipePatient(
          actor, id, [&](const Change& change) { wiped.set_value(change); });
      EXPECT_EQ(appliance_->WebStatus().next_purpose, ScanPurpose::kDailyCheck)
          << "the check stays open";
    });
    EXPECT_EQ(wiped.get_future().get().result, ChangeResult::kDone);
    On([&] {
      for (int i = 0; i < 2; ++i)
        EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), "");
    });
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    On([&] {
      EXPECT_NE(appliance_->WebStatus().next_purpose, ScanPurpose::kDailyCheck);
      EXPECT_EQ(appliance_->WebStatus().patient_id, "");
    });
  });
}

TEST_F(ApplianceTest, WhileAPatientIsBeingOpenedNoOtherIsOpenedAndNothingIsClosed) {
  parts_.demo_patient.clear();
  parts_.config.appliance.warm_up_min = 0;
  const Actor tess{.user = "tess", .address = {}};
  Play([&] {
    MakeReady();
    std::promise<Change> first;
    Change second, closed;
    std::string patient;
    On([&] {
      patient = shared_->store->patients.Add(tess, "A", "");
      const std::string other = shared_->store->patients.Add(tess, "B", "");
      AddPassedCheck(tess);
      auto& service = services_->services().patients;
      service.OpenPatient(tess, patient, ScanPurpose::kReference, "", "",
                          [&](const Change& change) { first.set_value(change); });
      service.OpenPatient(tess, other, ScanPurpose::kReference, "", "",
                          [&](const Change& change) { second = change; });
      service.CloseSession(tess, "", [&](const Change& change) { closed = change; });
      EXPECT_THAT(appliance_->Press(ButtonPress::kShort, tess).English(),
                  ::testing::HasSubstr("a patient is being opened"));
    });
    EXPECT_EQ(first.get_future().get().result, ChangeResult::kDone);
    for (const Change& refused : {second, closed}) {
      EXPECT_EQ(refused.result, ChangeResult::kConflict);
      EXPECT_EQ(refused.message.English(), "a patient is being opened: try again in a moment");
    }
    On([&] {
      ASSERT_TRUE(appliance_->WebStatus().session);
      EXPECT_EQ(appliance_->WebStatus().session->patient_id, patient);
      EXPECT_EQ(shared_->session.patient_id(), patient);
      EXPECT_EQ(appliance_->CloseSession(tess).English(), "");
    });
  });
}

TEST_F(ApplianceTest, AWipeThatIsRefusedLeavesTheSessionOpen) {
  parts_.demo_patient.clear();
  parts_.config.appliance.warm_up_min = 0;
  const Actor tess{.user = "tess", .address = {}};
  Play([&] {
    MakeReady();
    std::promise<Change> opened, refused, wiped;
    std::string patient, running;
    On([&] {
      patient = shared_->store->patients.Add(tess, "A", "");
      AddPassedCheck(tess);
      services_->services().patients.OpenPatient(
          tess, patient, ScanPurpose::kReference, "", "",
          [&](const Change& change) { opened.set_value(change); });
    });
    EXPECT_EQ(opened.get_future().get().result, ChangeResult::kDone);
    On([&] {
      running = shared_->store->scans.Begin({.patient_id = patient,
                                             .reference_id = {},
                                             .purpose = ScanPurpose::kReference,
                                             .sensor_serial = "A"});
      services_->services().patients.WipePatient(
          tess, patient, [&](const Change& change) { refused.set_value(change); });
      EXPECT_THAT(appliance_->Press(ButtonPress::kShort, tess).English(),
                  ::testing::HasSubstr("data is being removed"));
      EXPECT_THAT(appliance_->CloseSession(tess).English(),
                  ::testing::HasSubstr("data is being removed"));
    });
    EXPECT_THAT(refused.get_future().get().message.English(),
                ::testing::HasSubstr("a scan of this patient is running"));
    On([&] {
      ASSERT_TRUE(appliance_->WebStatus().session) << "nothing was removed";
      EXPECT_EQ(shared_->session.patient_id(), patient);
      shared_->store->scans.Finish(running, {.outcome = ScanOutcome::kCancelled,
                                             .failure = Message::Verbatim("discarded"),
                                             .swept_area_m2 = 0.0});
      services_->services().patients.WipePatient(
          tess, patient, [&](const Change& change) { wiped.set_value(change); });
    });
    EXPECT_EQ(wiped.get_future().get().result, ChangeResult::kDone);
    On([&] {
      EXPECT_FALSE(appliance_->WebStatus().session);
      EXPECT_EQ(shared_->session.patient_id(), "");
    });
  });
}

TEST_F(ApplianceTest, AReferenceThatHasChangedSinceItsApprovalGivesAFaultAndNoVerdict) {
  parts_.demo_patient.clear();
  parts_.config.appliance.warm_up_min = 0;
  Play([&] {
    MakeReady();
    std::string patient;
    On([&] {
      Store& store = *shared_->store.get();
      const Approved reference = AddApproved(store, kTester);
      patient = reference.patient;
      const std::filesystem::path cloud =
          store.folders.Scan(reference.scan) / "scene" / "cloud.ply";
      std::string bytes = ReadTextFile(cloud, 1000);
      bytes[3] = static_cast<char>(bytes[3] ^ 1);
      WriteWholeFile(cloud, bytes);
      OpenForFraction(*appliance_, shared_->store, patient, kTester);
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), "");
    });
    EXPECT_TRUE(Becomes([&] {
      bus_.GiveFrame();
      return appliance_->state().phase == ApplianceState::kFault;
    }));
    On([&] {
      EXPECT_THAT(
          appliance_->WebStatus().fault.English(),
          ::testing::HasSubstr("the patient's reference cannot be used: scene/cloud.ply has "
                               "been changed since it was stored"));
      EXPECT_TRUE(appliance_->StatusJson()["last_result"].is_null());
      const Scan failed = shared_->store->scans.List(patient, 1)[0];
      EXPECT_EQ(failed.outcome, ScanOutcome::kFailed);
      EXPECT_FALSE(failed.result);
    });
  });
}

TEST_F(ApplianceTest, AScanOfAnEarlierSessionOfThePatientIsNotAcceptedInTheNext) {
  parts_.demo_patient.clear();
  parts_.config.appliance.warm_up_min = 0;
  Play([&] {
    MakeReady();
    std::string patient;
    On([&] {
      patient = AddApproved(*shared_->store.get(), kTester).patient;
      OpenForFraction(*appliance_, shared_->store, patient, kTester);
      for (int i = 0; i < 2; ++i)
        EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), "");
    });
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    On([&] {
      const std::string scan = shared_->store->scans.List(patient, 1)[0].id;
      OpenForFraction(*appliance_, shared_->store, patient, kTester);
      Change accepted;
      services_->services().scans.AcceptScan(kTester, scan, "",
                                             [&](const Change& change) { accepted = change; });
      EXPECT_EQ(accepted.result, ChangeResult::kConflict);
      EXPECT_EQ(accepted.message.English(), say::scan::AcceptInSession().English());
    });
  });
}

TEST_F(ApplianceTest, ASweepThatIsDiscardedDoesNotMakeTheResultBeforeItValidAgain) {
  parts_.demo_patient.clear();
  parts_.config.appliance.warm_up_min = 0;
  Play([&] {
    MakeReady();
    std::string patient;
    const auto press = [&](ButtonPress how) {
      EXPECT_EQ(appliance_->Press(how, kTester).English(), "");
    };
    On([&] {
      patient = AddApproved(*shared_->store.get(), kTester).patient;
      OpenForFraction(*appliance_, shared_->store, patient, kTester);
      press(ButtonPress::kShort);
      press(ButtonPress::kShort);
    });
    ASSERT_TRUE(Becomes([&] { return !IsRunning() && appliance_->WebStatus().last_result; }));
    std::string scan;
    std::optional<std::string> refusal;
    On([&] {
      scan = appliance_->WebStatus().last_result->id;
      EXPECT_FALSE(appliance_->WebStatus().last_result->is_superseded);
      press(ButtonPress::kShort);
      press(ButtonPress::kLong);
    });
    ASSERT_TRUE(Becomes([&] { return !IsRunning(); }));
    On([&] {
      ASSERT_TRUE(appliance_->WebStatus().last_result);
      EXPECT_EQ(appliance_->WebStatus().last_result->id, scan);
      EXPECT_TRUE(appliance_->WebStatus().last_result->is_superseded);
      services_->services().scans.AcceptScan(
          kTester, scan, "", [&](const Change& change) { refusal = change.message.English(); });
    });
    ASSERT_TRUE(Becomes([&] { return refusal.has_value(); }));
    On([&] { EXPECT_EQ(refusal, say::store::ScanNotNewest().English()); });
  });
}

TEST_F(ApplianceTest, APlanThatCannotBeReadRefusesTheScanInWords) {
  parts_.demo_patient.clear();
  parts_.config.appliance.warm_up_min = 0;
  Play([&] {
    MakeReady();
    std::string patient;
    std::size_t num_scans = 0;
    const auto num_folders = [&] {
      const std::filesystem::directory_iterator folders(shared_->store->folders.scans());
      return std::distance(begin(folders), end(folders));
    };
    On([&] {
      Store& store = *shared_->store.get();
      patient = AddApproved(store, kTester).patient;
      store.database().ForChanges()->Prepare("DROP TRIGGER refs_immutable").Run();
      store.database().ForChanges()->Prepare("UPDATE refs SET plan = '{'").Run();
      num_scans = store.scans.List(patient, 10).size();
      OpenForFraction(*appliance_, shared_->store, patient, kTester);
    });
    const auto folders_before = num_folders();
    On([&] { EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), ""); });
    EXPECT_TRUE(Becomes([&] { return appliance_->state().phase == ApplianceState::kFault; }));
    On([&] {
      EXPECT_THAT(appliance_->WebStatus().fault.English(),
                  ::testing::HasSubstr("the scan could not begin: version 1 of the reference"));
      EXPECT_EQ(appliance_->WebStatus().light, "fault");
      EXPECT_FALSE(appliance_->WebStatus().scan);
      EXPECT_EQ(shared_->storage.fault().English(), "") << "other patients can be scanned";
      EXPECT_TRUE(appliance_->StatusJson()["last_result"].is_null());
      EXPECT_EQ(shared_->store->scans.List(patient, 10).size(), num_scans);
      EXPECT_EQ(num_folders(), folders_before);
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), "")
          << "acknowledges the fault";
      EXPECT_EQ(appliance_->state().phase, ApplianceState::kReady);
    });
  });
}

TEST_F(ApplianceTest, WithoutTodaysCheckNoReferenceIsScannedOrApproved) {
  parts_.demo_patient.clear();
  parts_.config.appliance.warm_up_min = 0;
  Play([&] {
    MakeReady();
    const Actor tess = {.user = "tess", .address = {}};
    Change answer;
    const Done keep = [&](const Change& change) { answer = change; };
    std::string patient;
    On([&] {
      patient = shared_->store->patients.Add(tess, "P-1", "");
      EXPECT_THAT(appliance_->WebStatus().reference_block.English(),
                  ::testing::HasSubstr("daily check"));
      services_->services().patients.OpenPatient(tess, patient, ScanPurpose::kReference, "", "",
                                                 keep);
      EXPECT_EQ(answer.result, ChangeResult::kConflict);
      EXPECT_THAT(answer.message.English(), ::testing::HasSubstr("open Daily check"));
      services_->services().references.ApproveReference(tess, "1", 1, "", {}, keep);
      EXPECT_THAT(answer.message.English(), ::testing::HasSubstr("open Daily check"));
      services_->services().references.AddReference(tess, "1", "", keep);
      EXPECT_THAT(answer.message.English(), ::testing::HasSubstr("open Daily check"));
      // A session that was open since yesterday.
      appliance_->OpenSession("1", patient, ScanPurpose::kReference, "", tess);
      (void)appliance_->Press(ButtonPress::kShort, kTester);
    });
    EXPECT_TRUE(Becomes([&] {
      return appliance_->WebStatus().fault.English().find("open Daily check") != std::string::npos;
    }));
    On([&] {
      EXPECT_TRUE(shared_->store->scans.List("", 10).empty()) << "nothing was scanned";
      AddPassedCheck(tess);
      EXPECT_EQ(appliance_->WebStatus().reference_block.English(), "");
      EXPECT_EQ(shared_->references.WhyNot(ScanOf(DailyCheck::kPassed)).English(), "");
      EXPECT_THAT(shared_->references.WhyNot(ScanOf(DailyCheck::kOverdue)).English(),
                  ::testing::HasSubstr("scan the reference again"))
          << "of a scan from before the check";
      const auto check = [&](MarkerCheckStatus status) {
        (void)shared_->store->checks.Add(
            tess, appliance_->WebStatus().sensor.serial,
            TakenCheck{{.status = status, .items = {}, .reasons = {}}});
      };
      check(MarkerCheckStatus::kFailed);
      const web::Json status = web::ToJson(appliance_->WebStatus(), WallClock::now());
      EXPECT_TRUE(status["check_overdue"]);
      EXPECT_TRUE(status["check_failed"]);
      EXPECT_EQ(shared_->references.Checks().today, DailyCheck::kFailed);
      EXPECT_THAT(shared_->references.WhyNot(ScanOf(DailyCheck::kPassed)).English(),
                  ::testing::HasSubstr("the daily check has failed"))
          << "after one that had passed";
      check(MarkerCheckStatus::kPassed);
      EXPECT_EQ(shared_->references.WhyNot(ScanOf(DailyCheck::kPassed)).English(), "");
      EXPECT_THAT(shared_->references.WhyNot(ScanOf(DailyCheck::kFailed)).English(),
                  ::testing::HasSubstr("after a failed daily check"));
      (void)appliance_->CloseSession(tess);
      (void)appliance_->Press(ButtonPress::kShort, kTester);  // acknowledges the fault
      services_->services().patients.OpenPatient(tess, patient, ScanPurpose::kReference, "", "",
                                                 keep);
    });
    EXPECT_TRUE(Becomes([&] { return appliance_->WebStatus().session.has_value(); }));
  });
}

TEST_F(ApplianceTest, WhereTheSettingsAskForItNoSweepBeginsBeforeTheWristbandWasScanned) {
  parts_.demo_patient.clear();
  const Actor tess = {.user = "tess", .address = {}};
  Play([&] {
    MakeReady();
    std::string session;
    Change answer;
    std::promise<void> confirmed;
    const auto confirm = [&](const std::string& of, const std::string& code) {
      services_->services().patients.ConfirmWristband(
          tess, of, code, [&](const Change& change) { answer = change; });
      return answer.message.English();
    };
    On([&] {
      Store& store = *shared_->store.get();
      Settings settings;
      settings.scan_wristband = true;
      store.settings.Change(tess, settings);
      const Approved approved = AddApproved(store, tess);
      (void)store.patients.Add(tess, "P-2", "");
      OpenForFraction(*appliance_, shared_->store, approved.patient, tess);
      session = appliance_->WebStatus().session.value().id;
      EXPECT_TRUE(appliance_->WebStatus().wants_wristband);
      // The button, the page and the control socket (whose press is the button's).
      const std::string first = say::scan::WristbandFirst().English();
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), first);
      EXPECT_EQ(appliance_->StartSweep(tess).English(), first);
      EXPECT_EQ(appliance_->state().phase, ApplianceState::kReady);
      // Another patient's, one that nobody has, and another session change nothing.
      for (const char* code : {"P-2", "P-9", ""})
        EXPECT_EQ(confirm(session, code), say::scan::OtherWristband("P-1").English()) << code;
      EXPECT_EQ(confirm("99", "P-1"), say::scan::SessionClosed().English());
      EXPECT_EQ(appliance_->StartSweep(tess).English(), first);
      // A daily check is of nobody.
      EXPECT_EQ(appliance_->PrepareCheck(/*opens=*/true, tess).English(), "");
      EXPECT_FALSE(appliance_->WebStatus().wants_wristband);
      EXPECT_EQ(appliance_->PrepareCheck(/*opens=*/false, tess).English(), "");
      services_->services().patients.ConfirmWristband(
          tess, session, "p 1", [&](const Change&) { confirmed.set_value(); });
      EXPECT_FALSE(appliance_->WebStatus().wants_wristband);
    });
    confirmed.get_future().get();
    On([&] {
      EXPECT_EQ(shared_->store->audit.Find({0, 1}).at(0).action, "session.wristband");
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), "");
      EXPECT_EQ(appliance_->state().phase, ApplianceState::kScanning);
      EXPECT_TRUE(appliance_->WebStatus().wants_wristband) << "for the next one";
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), "") << "its end";
    });
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    On([&] {
      (void)appliance_->Press(ButtonPress::kShort, kTester);  // acknowledges what became of it
      EXPECT_EQ(appliance_->StartSweep(tess).English(), say::scan::WristbandFirst().English());
      shared_->store->settings.Change(tess, Settings{});
      EXPECT_FALSE(appliance_->WebStatus().wants_wristband) << "the setting is off again";
      EXPECT_EQ(appliance_->StartSweep(tess).English(), "");
    });
  });
}

TEST_F(ApplianceTest, AWristbandCountsForTenMinutesAndForTheSessionInWhichItWasScanned) {
  using std::chrono::minutes, std::chrono::seconds;
  CurrentSession session(loop_, parts_.config, [] {});
  const auto scanned = std::chrono::steady_clock::time_point(minutes(5));
  EXPECT_FALSE(session.LacksWristband(scanned)) << "a scan of nobody";
  session.Open("1", "1", ScanPurpose::kFraction, "", {.user = "tess", .address = {}});
  EXPECT_TRUE(session.LacksWristband(scanned));
  session.ConfirmWristband(scanned);
  EXPECT_FALSE(session.LacksWristband(scanned + kWristbandHolds - seconds(1)));
  EXPECT_TRUE(session.LacksWristband(scanned + kWristbandHolds));
  session.SetCheck(Actor{.user = "tess", .address = {}});
  session.UseUpWristband();
  session.SetCheck(std::nullopt);
  EXPECT_FALSE(session.LacksWristband(scanned)) << "a check uses nothing up";
  session.UseUpWristband();
  EXPECT_TRUE(session.LacksWristband(scanned));
  session.ConfirmWristband(scanned);
  session.Open("2", "1", ScanPurpose::kFraction, "", {.user = "tess", .address = {}});
  EXPECT_TRUE(session.LacksWristband(scanned)) << "another session";
}

TEST_F(ApplianceTest, ASessionWithoutScansClosesByItself) {
  parts_.demo_patient.clear();
  parts_.config.appliance.session_idle_min = 0.3 / 60;
  Play([&] {
    MakeReady();
    const Actor tess = {.user = "tess", .address = {}};
    On([&] {
      const std::string patient = shared_->store->patients.Add(tess, "P-1", "");
      const std::string session =
          shared_->store->treatments.Open(tess, patient, ScanPurpose::kReference);
      appliance_->OpenSession(session, patient, ScanPurpose::kReference, "", tess);
      EXPECT_TRUE(appliance_->WebStatus().session.has_value());
    });
    EXPECT_TRUE(Becomes([&] { return !appliance_->WebStatus().session.has_value(); }));
    EXPECT_TRUE(Becomes([&] { return !shared_->store->treatments.Opened().has_value(); }));
  });
}

TEST_F(ApplianceTest, AColdSensorTakesNoReference) {
  parts_.demo_patient.clear();
  ASSERT_EQ(parts_.config.appliance.warm_up_min, 15);
  Play([&] {
    MakeReady();
    On([&] {
      (void)shared_->store->checks.Add(
          {.user = "tess", .address = {}}, appliance_->WebStatus().sensor.serial,
          {.check = {.status = MarkerCheckStatus::kPassed, .items = {}, .reasons = {}}});
      EXPECT_THAT(appliance_->WebStatus().reference_block.English(),
                  ::testing::HasSubstr("the sensor is still warming up"));
      EXPECT_THAT(appliance_->WebStatus().reference_block.English(),
                  ::testing::HasSubstr("15 min"));
      // What was scanned long ago is judged by how warm the sensor was then.
      Scan scan = ScanOf(DailyCheck::kPassed);
      scan.sensor_on_s = 899;
      EXPECT_THAT(shared_->references.WhyNot(scan).English(),
                  ::testing::HasSubstr("scan the reference again"));
      scan.sensor_on_s = 900;
      EXPECT_EQ(shared_->references.WhyNot(scan).English(), "");
      scan.sensor_on_s.reset();
      EXPECT_EQ(shared_->references.WhyNot(scan).English(), "")
          << "not known: from an older version";
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
      return web::ToJson(appliance_->WebStatus(), WallClock::now())["sensor"]["warm_up_s"];
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
      EXPECT_EQ(appliance_->WebStatus().daily_check, DailyCheck::kOverdue);
      EXPECT_EQ(appliance_->WebStatus().reference_block.English(), "");
      EXPECT_EQ(shared_->references.WhyNot(ScanOf(DailyCheck::kOverdue)).English(), "");
    });
  });
}

}  // namespace
}  // namespace plumb
