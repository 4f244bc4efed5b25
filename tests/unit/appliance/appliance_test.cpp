// Workers, sessions and references of the appliance.
#include <sys/eventfd.h>
#include <unistd.h>

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

#include "daemon/files/compact_map.hpp"
#include "daemon/files/ply_file.hpp"
#include "daemon/records/check_json.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/unit/appliance/appliance_fixture.hpp"
#include "tests/unit/records/scan_folder.hpp"
#include "web/api/json.hpp"

namespace plumb {
namespace {

using testing::ApplianceTest;

Scan ScanOf(DailyCheck check) {
  Scan scan;
  scan.id = "1";
  scan.daily_check = check;
  return scan;
}

TEST_F(ApplianceTest, AWorkerIsNotAliveWhileADriverDoesNotComeBackFromOpening) {
  parts_.sensor_silence_s = 0.7;
  Play([&] {
    bus_.Plug("A");
    EXPECT_TRUE(Becomes([&] { return !appliance_->WorkersAreAlive(); }));
    On([&] { EXPECT_FALSE(appliance_->health().ok); });
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
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester), "");
      EXPECT_EQ(appliance_->state().phase, ApplianceState::kScanning);
      EXPECT_TRUE(appliance_->WorkersAreAlive()) << "it waits for frames";
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester), "");
      EXPECT_EQ(appliance_->state().phase, ApplianceState::kWorking);
      EXPECT_FALSE(appliance_->WorkersAreAlive());
    });
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    On([&] { EXPECT_TRUE(appliance_->WorkersAreAlive()); });
  });
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
      EXPECT_EQ(appliance_->OpenCheck(actor), "");
      services_->services().patients.WipePatient(
          actor, id, [&](const Change& change) { wiped.set_value(change); });
      EXPECT_EQ(appliance_->WebStatus().next_purpose, ScanPurpose::kDailyCheck)
          << "the check stays open";
    });
    EXPECT_EQ(wiped.get_future().get().result, ChangeResult::kDone);
    On([&] {
      for (int i = 0; i < 2; ++i) EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester), "");
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
      patient = appliance_->store()->patients.Add(tess, "A", "");
      const std::string other = appliance_->store()->patients.Add(tess, "B", "");
      AddPassedCheck(tess);
      auto& service = services_->services().patients;
      service.OpenPatient(tess, patient, ScanPurpose::kReference, "", "",
                          [&](const Change& change) { first.set_value(change); });
      service.OpenPatient(tess, other, ScanPurpose::kReference, "", "",
                          [&](const Change& change) { second = change; });
      service.CloseSession(tess, "", [&](const Change& change) { closed = change; });
      EXPECT_THAT(appliance_->Press(ButtonPress::kShort, tess),
                  ::testing::HasSubstr("a patient is being opened"));
    });
    EXPECT_EQ(first.get_future().get().result, ChangeResult::kDone);
    for (const Change& refused : {second, closed}) {
      EXPECT_EQ(refused.result, ChangeResult::kConflict);
      EXPECT_EQ(refused.message, "a patient is being opened: try again in a moment");
    }
    On([&] {
      ASSERT_TRUE(appliance_->WebStatus().session);
      EXPECT_EQ(appliance_->WebStatus().session->patient_id, patient);
      EXPECT_EQ(appliance_->session().patient_id(), patient);
      EXPECT_EQ(appliance_->CloseSession(tess), "");
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
      patient = appliance_->store()->patients.Add(tess, "A", "");
      AddPassedCheck(tess);
      services_->services().patients.OpenPatient(
          tess, patient, ScanPurpose::kReference, "", "",
          [&](const Change& change) { opened.set_value(change); });
    });
    EXPECT_EQ(opened.get_future().get().result, ChangeResult::kDone);
    On([&] {
      running = appliance_->store()->scans.Begin({.patient_id = patient,
                                                  .reference_id = {},
                                                  .purpose = ScanPurpose::kReference,
                                                  .sensor_serial = "A"});
      services_->services().patients.WipePatient(
          tess, patient, [&](const Change& change) { refused.set_value(change); });
      EXPECT_THAT(appliance_->Press(ButtonPress::kShort, tess),
                  ::testing::HasSubstr("data is being removed"));
      EXPECT_THAT(appliance_->CloseSession(tess), ::testing::HasSubstr("data is being removed"));
    });
    EXPECT_THAT(refused.get_future().get().message,
                ::testing::HasSubstr("a scan of this patient is running"));
    On([&] {
      ASSERT_TRUE(appliance_->WebStatus().session) << "nothing was removed";
      EXPECT_EQ(appliance_->session().patient_id(), patient);
      appliance_->store()->scans.Finish(
          running,
          {.outcome = ScanOutcome::kCancelled, .failure = "discarded", .swept_area_m2 = 0.0});
      services_->services().patients.WipePatient(
          tess, patient, [&](const Change& change) { wiped.set_value(change); });
    });
    EXPECT_EQ(wiped.get_future().get().result, ChangeResult::kDone);
    On([&] {
      EXPECT_FALSE(appliance_->WebStatus().session);
      EXPECT_EQ(appliance_->session().patient_id(), "");
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
      Store& store = *appliance_->store();
      patient = store.patients.Add(kTester, "P-1", "");
      const std::string scan = testing::StoreScan(store, patient);
      (void)testing::PlanAndApprove(store, store.references.Add(testing::kAnna, scan, "", {}));
      const std::filesystem::path cloud = store.folders.Scan(scan) / "scene" / "cloud.ply";
      std::string bytes = ReadTextFile(cloud, 1000);
      bytes[3] = static_cast<char>(bytes[3] ^ 1);
      WriteWholeFile(cloud, bytes);
      const std::string session = store.treatments.Open(kTester, patient, ScanPurpose::kFraction);
      appliance_->OpenSession(session, patient, ScanPurpose::kFraction, "", kTester);
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester), "");
    });
    EXPECT_TRUE(Becomes([&] {
      bus_.GiveFrame();
      return appliance_->state().phase == ApplianceState::kFault;
    }));
    On([&] {
      EXPECT_THAT(
          appliance_->WebStatus().fault,
          ::testing::HasSubstr("the patient's reference cannot be used: scene/cloud.ply has "
                               "been changed since it was stored"));
      EXPECT_TRUE(appliance_->StatusJson()["last_result"].is_null());
      const Scan failed = appliance_->store()->scans.List(patient, 1)[0];
      EXPECT_EQ(failed.outcome, ScanOutcome::kFailed);
      EXPECT_FALSE(failed.result);
    });
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
      const std::filesystem::directory_iterator folders(appliance_->store()->folders.scans());
      return std::distance(begin(folders), end(folders));
    };
    On([&] {
      Store& store = *appliance_->store();
      patient = store.patients.Add(kTester, "P-1", "");
      const std::string scan = testing::StoreScan(store, patient);
      (void)testing::PlanAndApprove(store, store.references.Add(testing::kAnna, scan, "", {}));
      store.database().ForChanges()->Prepare("DROP TRIGGER refs_immutable").Run();
      store.database().ForChanges()->Prepare("UPDATE refs SET plan = '{'").Run();
      num_scans = store.scans.List(patient, 10).size();
      const std::string session = store.treatments.Open(kTester, patient, ScanPurpose::kFraction);
      appliance_->OpenSession(session, patient, ScanPurpose::kFraction, "", kTester);
    });
    const auto folders_before = num_folders();
    On([&] { EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester), ""); });
    EXPECT_TRUE(Becomes([&] { return appliance_->state().phase == ApplianceState::kFault; }));
    On([&] {
      EXPECT_THAT(appliance_->WebStatus().fault,
                  ::testing::HasSubstr("the scan could not begin: version 1 of the reference"));
      EXPECT_EQ(appliance_->WebStatus().light, "fault");
      EXPECT_FALSE(appliance_->WebStatus().scan);
      EXPECT_EQ(appliance_->storage_fault(), "") << "other patients can be scanned";
      EXPECT_TRUE(appliance_->StatusJson()["last_result"].is_null());
      EXPECT_EQ(appliance_->store()->scans.List(patient, 10).size(), num_scans);
      EXPECT_EQ(num_folders(), folders_before);
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester), "") << "acknowledges the fault";
      EXPECT_EQ(appliance_->state().phase, ApplianceState::kReady);
    });
  });
}

TEST_F(ApplianceTest, ASurfaceIsPackedOnceAndAFailureIsNotKept) {
  Play([&] {
    MakeReady();
    const auto mesh = [&](const Scan& scan) { return scan.folder / "scene/mesh.ply"; };
    const auto packed = [&](const Scan& scan) {
      return services_->services().scans.CompactMap(scan.id, "mesh");
    };
    std::vector<Scan> scans;
    On([&] {
      Store& store = *appliance_->store();
      const std::string patient = store.patients.Add(kTester, "P-1", "");
      for (int i = 0; i < 3; ++i) {
        const std::string id = store.scans.Begin({.patient_id = patient,
                                                  .reference_id = {},
                                                  .purpose = ScanPurpose::kFraction,
                                                  .sensor_serial = "A"});
        std::filesystem::create_directory(store.folders.Staging(id) / "scene");
        store.scans.Finish(id, {.outcome = ScanOutcome::kDone});
        scans.push_back(store.scans.Find(id).value());
      }
    });
    TriangleMesh triangle;
    triangle.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    triangle.normals.assign(3, Eigen::Vector3f::UnitZ());
    triangle.triangles = {{0, 1, 2}};
    EXPECT_FALSE(packed(scans[0])) << "it has none yet";
    for (const Scan& scan : scans) {
      triangle.vertices[0].z() += 0.1F;
      WriteMeshPly(mesh(scan), triangle);
      EXPECT_EQ(packed(scan), CompactMesh(triangle));
      std::filesystem::remove(mesh(scan));
    }
    EXPECT_EQ(packed(scans[2]), CompactMesh(triangle)) << "not read again";
    EXPECT_TRUE(packed(scans[1]));
    EXPECT_NE(packed(scans[1]), packed(scans[2]));
    EXPECT_FALSE(packed(scans[0])) << "only two are kept";
    EXPECT_FALSE(services_->services().scans.CompactMap(scans[1].id, "heightmap"));
    On([&] { appliance_->store()->removal.RemoveScan(kTester, scans[2].id, "a test"); });
    EXPECT_FALSE(packed(scans[2])) << "gone with its scan";
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
      patient = appliance_->store()->patients.Add(tess, "P-1", "");
      EXPECT_THAT(appliance_->WebStatus().reference_block, ::testing::HasSubstr("daily check"));
      services_->services().patients.OpenPatient(tess, patient, ScanPurpose::kReference, "", "",
                                                 keep);
      EXPECT_EQ(answer.result, ChangeResult::kConflict);
      EXPECT_THAT(answer.message, ::testing::HasSubstr("open Daily check"));
      services_->services().references.ApproveReference(tess, "1", 1, "", keep);
      EXPECT_THAT(answer.message, ::testing::HasSubstr("open Daily check"));
      services_->services().references.AddReference(tess, "1", "", keep);
      EXPECT_THAT(answer.message, ::testing::HasSubstr("open Daily check"));
      // A session that was open since yesterday.
      appliance_->OpenSession("1", patient, ScanPurpose::kReference, "", tess);
      (void)appliance_->Press(ButtonPress::kShort, kTester);
    });
    EXPECT_TRUE(Becomes([&] {
      return appliance_->WebStatus().fault.find("open Daily check") != std::string::npos;
    }));
    On([&] {
      EXPECT_TRUE(appliance_->store()->scans.List("", 10).empty()) << "nothing was scanned";
      AddPassedCheck(tess);
      EXPECT_EQ(appliance_->WebStatus().reference_block, "");
      EXPECT_EQ(appliance_->references().WhyNot(ScanOf(DailyCheck::kPassed)), "");
      EXPECT_THAT(appliance_->references().WhyNot(ScanOf(DailyCheck::kOverdue)),
                  ::testing::HasSubstr("scan the reference again"))
          << "of a scan from before the check";
      const auto check = [&](MarkerCheckStatus status) {
        (void)appliance_->store()->checks.Add(
            tess, appliance_->WebStatus().sensor.serial,
            TakenCheck{{.status = status, .items = {}, .reasons = {}}});
      };
      check(MarkerCheckStatus::kFailed);
      const web::Json status = web::ToJson(appliance_->WebStatus(), WallClock::now());
      EXPECT_TRUE(status["check_overdue"]);
      EXPECT_TRUE(status["check_failed"]);
      EXPECT_EQ(appliance_->references().Checks().today, DailyCheck::kFailed);
      EXPECT_THAT(appliance_->references().WhyNot(ScanOf(DailyCheck::kPassed)),
                  ::testing::HasSubstr("the daily check has failed"))
          << "after one that had passed";
      check(MarkerCheckStatus::kPassed);
      EXPECT_EQ(appliance_->references().WhyNot(ScanOf(DailyCheck::kPassed)), "");
      EXPECT_THAT(appliance_->references().WhyNot(ScanOf(DailyCheck::kFailed)),
                  ::testing::HasSubstr("after a failed daily check"));
      (void)appliance_->CloseSession(tess);
      (void)appliance_->Press(ButtonPress::kShort, kTester);  // acknowledges the fault
      services_->services().patients.OpenPatient(tess, patient, ScanPurpose::kReference, "", "",
                                                 keep);
    });
    EXPECT_TRUE(Becomes([&] { return appliance_->WebStatus().session.has_value(); }));
  });
}

TEST_F(ApplianceTest, TheLogSaysWhichScanWasStartedEndedAndDiscarded) {
  parts_.demo_patient.clear();
  parts_.config.appliance.warm_up_min = 0;
  const Actor tess{.user = "tess", .address = {}};
  // "code number kind" of an action's newest entry.
  const auto logged = [&](const std::string& action) {
    const auto entries = appliance_->store()->audit.Find({0, 1, action});
    if (entries.empty()) return std::string("nothing");
    const auto& about = entries[0].about;
    return (about ? about->patient_code + " " + std::to_string(about->number) : "no subject:") +
           " " + entries[0].detail;
  };
  Play([&] {
    MakeReady();
    web::ApplianceService& service = services_->services().appliance;
    const auto scan = [&](const std::string& kind) {
      On([&] { service.StartSweep(tess, [](const Change&) {}); });
      EXPECT_TRUE(Becomes([&] { return logged("scan.start") == kind; })) << kind;
      On([&] {  // both before its end can arrive
        service.EndSweep(tess, [](const Change&) {});
        service.Cancel(tess, [](const Change&) {});
      });
      EXPECT_TRUE(Becomes([&] { return logged("scan.end") == kind; })) << kind;
      EXPECT_TRUE(Becomes([&] { return logged("cancel") == kind; })) << kind;
      EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    };
    scan("no subject: unassigned");
    On([&] { EXPECT_EQ(appliance_->OpenCheck(tess), ""); });
    scan("no subject: daily_check");
    On([&] {
      Store& store = *appliance_->store();
      (void)store.checks.Add(
          tess, appliance_->WebStatus().sensor.serial,
          TakenCheck{{.status = MarkerCheckStatus::kPassed, .items = {}, .reasons = {}}});
      const std::string patient = store.patients.Add(tess, "P-1", "");
      const std::string session = store.treatments.Open(tess, patient, ScanPurpose::kReference);
      appliance_->OpenSession(session, patient, ScanPurpose::kReference, "", tess);
    });
    scan("P-1 0 reference");
  });
}

/// A button that is pressed by the test, on the loop's thread.
class FakeButton : public Button {
 public:
  FakeButton() : fd_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}
  ~FakeButton() override { ::close(fd_); }
  FakeButton(const FakeButton&) = delete;
  FakeButton& operator=(const FakeButton&) = delete;
  [[nodiscard]] int fd() const override { return fd_; }
  [[nodiscard]] std::optional<Clock::time_point> deadline() const override { return {}; }
  void Dispatch(Clock::time_point /*now*/) override {}
  void SetListener(std::function<void(ButtonPress)> pressed) override {
    press = std::move(pressed);
  }
  std::function<void(ButtonPress)> press;

 private:
  const int fd_;
};

TEST_F(ApplianceTest, TheLogSaysWhatEachPressDidAndNothingTwice) {
  parts_.demo_patient.clear();
  parts_.config.appliance.warm_up_min = 0;
  FakeButton button;
  parts_.button = &button;
  // "who action: code number, detail" of each entry about scans, the oldest first.
  const auto logged = [&] {
    std::vector<std::string> lines;
    for (const AuditEntry& entry : appliance_->store()->audit.Find({0, 100, ""})) {
      if (!entry.action.starts_with("scan.") && entry.action != "cancel" &&
          entry.action != "press" && entry.action != "session.close")
        continue;
      const auto& about = entry.about;
      lines.insert(lines.begin(),
                   entry.user + " " + entry.action + ": " +
                       (about ? about->patient_code + " " + std::to_string(about->number) : "") +
                       ", " + entry.detail);
    }
    return lines;
  };
  Play([&] {
    MakeReady();
    web::ApplianceService& service = services_->services().appliance;
    const auto page = [&] { service.Press(kTester, [](const Change&) {}); };
    std::vector<std::string> expected;
    const auto expect = [&](const std::vector<std::string>& lines) {
      expected.insert(expected.end(), lines.begin(), lines.end());
      EXPECT_TRUE(Becomes([&] { return logged().size() >= expected.size(); }));
      On([&] { EXPECT_EQ(logged(), expected); });
    };
    // Starts, ends, and discards it before its result can arrive.
    On([&] {
      for (const ButtonPress kind : {ButtonPress::kShort, ButtonPress::kShort, ButtonPress::kLong})
        button.press(kind);
    });
    expect({"button scan.start: , unassigned", "button scan.end: , unassigned",
            "button cancel: , unassigned"});
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    std::string patient;
    On([&] {
      Store& store = *appliance_->store();
      patient = store.patients.Add(kTester, "P-1", "");
      const std::string session = store.treatments.Open(kTester, patient, ScanPurpose::kReference);
      appliance_->OpenSession(session, patient, ScanPurpose::kReference, "", kTester);
      page();  // without a check of the day the scan cannot begin
    });
    expect({"tester scan.start: P-1 0, reference"});
    EXPECT_TRUE(Becomes([&] { return appliance_->state().phase == ApplianceState::kFault; }));
    On([&] {
      page();
      (void)appliance_->store()->checks.Add(
          kTester, appliance_->WebStatus().sensor.serial,
          TakenCheck{{.status = MarkerCheckStatus::kPassed, .items = {}, .reasons = {}}});
      page();
      page();
      button.press(ButtonPress::kShort);  // refused: the result is being computed
      button.press(ButtonPress::kLong);
    });
    expect({"tester press: , ready", "tester scan.start: P-1 0, reference",
            "tester scan.end: P-1 0, reference", "button cancel: P-1 0, reference"});
    EXPECT_TRUE(Becomes([&] { return appliance_->state().phase == ApplianceState::kReady; }));
    On([&] { button.press(ButtonPress::kLong); });
    expect({"button session.close: P-1 0, "});
  });
}

TEST_F(ApplianceTest, ASessionWithoutScansClosesByItself) {
  parts_.demo_patient.clear();
  parts_.config.appliance.session_idle_min = 0.3 / 60;
  Play([&] {
    MakeReady();
    const Actor tess = {.user = "tess", .address = {}};
    On([&] {
      const std::string patient = appliance_->store()->patients.Add(tess, "P-1", "");
      const std::string session =
          appliance_->store()->treatments.Open(tess, patient, ScanPurpose::kReference);
      appliance_->OpenSession(session, patient, ScanPurpose::kReference, "", tess);
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
      Scan scan = ScanOf(DailyCheck::kPassed);
      scan.sensor_on_s = 899;
      EXPECT_THAT(appliance_->references().WhyNot(scan),
                  ::testing::HasSubstr("scan the reference again"));
      scan.sensor_on_s = 900;
      EXPECT_EQ(appliance_->references().WhyNot(scan), "");
      scan.sensor_on_s.reset();
      EXPECT_EQ(appliance_->references().WhyNot(scan), "") << "not known: from an older version";
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
      EXPECT_EQ(appliance_->WebStatus().reference_block, "");
      EXPECT_EQ(appliance_->references().WhyNot(ScanOf(DailyCheck::kOverdue)), "");
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
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester), "") << "scans go on";
      EXPECT_EQ(appliance_->WebStatus().light, "scanning");
      EXPECT_EQ(appliance_->Cancel(kTester), "");
    });
    EXPECT_TRUE(Becomes([&] { return appliance_->WebStatus().light == "ready_rolled_back"; }));
    On([&] {
      appliance_->SetRolledBack({});
      EXPECT_EQ(appliance_->WebStatus().light, "ready");
    });
  });
}

TEST_F(ApplianceTest, TheProvisionedDisplayIsPairedWhenItsStoreOpens) {
  std::filesystem::create_directories(folder_ / "state");
  WriteWholeFile(folder_ / "state" / "provisioned-display", std::string(64, 'a') + " Room 1\n");
  Play([&] {
    On([&] {
      const std::vector<Display> paired = appliance_->store()->displays.List();
      ASSERT_EQ(paired.size(), 1U);
      EXPECT_EQ(paired[0].name, "Room 1");
      EXPECT_EQ(paired[0].token_hash, std::string(64, 'a'));
    });
  });
}

TEST_F(ApplianceTest, AProvisionedDisplayThatCannotBeReadDoesNotPreventScanning) {
  std::filesystem::create_directories(folder_ / "state");
  WriteWholeFile(folder_ / "state" / "provisioned-display", std::string(63, 'a') + " Room 1\n");
  Play([&] {
    MakeReady();
    On([&] {
      EXPECT_EQ(appliance_->storage_fault(), "");
      EXPECT_TRUE(appliance_->store()->displays.List().empty());
    });
  });
}

}  // namespace
}  // namespace plumb
