// SPDX-License-Identifier: Apache-2.0
// Workers, button, log, surface and displays of the appliance.
#include <sys/eventfd.h>
#include <unistd.h>

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "algo/base/message_json.hpp"
#include "daemon/files/compact_map.hpp"
#include "daemon/files/ply_file.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/unit/appliance/appliance_fixture.hpp"
#include "words/scan.hpp"
#include "words/upkeep.hpp"

namespace plumb {
namespace {

using testing::ApplianceTest;

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
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), "");
      EXPECT_EQ(appliance_->state().phase, ApplianceState::kScanning);
      EXPECT_TRUE(appliance_->WorkersAreAlive()) << "it waits for frames";
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), "");
      EXPECT_EQ(appliance_->state().phase, ApplianceState::kWorking);
      EXPECT_FALSE(appliance_->WorkersAreAlive());
    });
    EXPECT_TRUE(Becomes([&] { return !IsRunning(); }));
    On([&] { EXPECT_TRUE(appliance_->WorkersAreAlive()); });
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
      Store& store = *shared_->store.get();
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
    On([&] { shared_->store->removal.RemoveScan(kTester, scans[2].id, "a test"); });
    EXPECT_FALSE(packed(scans[2])) << "gone with its scan";
  });
}

TEST_F(ApplianceTest, TheLogSaysWhichScanWasStartedEndedAndDiscarded) {
  parts_.demo_patient.clear();
  parts_.config.appliance.warm_up_min = 0;
  const Actor tess{.user = "tess", .address = {}};
  // "code number kind" of an action's newest entry.
  const auto logged = [&](const std::string& action) {
    const auto entries = shared_->store->audit.Find({0, 1, action});
    if (entries.empty()) return std::string("nothing");
    const auto& about = entries[0].about;
    return (about ? about->patient_code + " " + std::to_string(about->number) : "no subject:") +
           " " + entries[0].detail.English();
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
    On([&] { EXPECT_EQ(appliance_->PrepareCheck(/*opens=*/true, tess).English(), ""); });
    scan("no subject: daily check");
    On([&] {
      EXPECT_NE(appliance_->PrepareCheck(/*opens=*/false, tess).English(), "") << "it was scanned";
      // It may have ended before it could be discarded; a long press then leaves its result first.
      if (appliance_->state().phase == ApplianceState::kResult)
        (void)appliance_->Press(ButtonPress::kLong, tess);
      for (const bool by_button : {false, true}) {
        EXPECT_EQ(appliance_->PrepareCheck(/*opens=*/true, tess).English(), "");
        EXPECT_EQ((by_button ? appliance_->Press(ButtonPress::kLong, tess)
                             : appliance_->PrepareCheck(/*opens=*/false, tess))
                      .English(),
                  "");
        EXPECT_NE(appliance_->WebStatus().next_purpose, ScanPurpose::kDailyCheck) << by_button;
      }
    });
    EXPECT_TRUE(Becomes([&] { return logged("check.leave") == "no subject: "; }));
    On([&] {
      Store& store = *shared_->store.get();
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
    for (const AuditEntry& entry : shared_->store->audit.Find({0, 100, ""})) {
      if (!entry.action.starts_with("scan.") && entry.action != "cancel" &&
          entry.action != "press" && entry.action != "session.close")
        continue;
      const auto& about = entry.about;
      lines.insert(lines.begin(),
                   entry.user + " " + entry.action + ": " +
                       (about ? about->patient_code + " " + std::to_string(about->number) : "") +
                       ", " + entry.detail.English());
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
      Store& store = *shared_->store.get();
      patient = store.patients.Add(kTester, "P-1", "");
      const std::string session = store.treatments.Open(kTester, patient, ScanPurpose::kReference);
      appliance_->OpenSession(session, patient, ScanPurpose::kReference, "", kTester);
      page();  // without a check of the day the scan cannot begin
    });
    expect({"tester scan.start: P-1 0, reference"});
    EXPECT_TRUE(Becomes([&] { return appliance_->state().phase == ApplianceState::kFault; }));
    On([&] {
      page();
      (void)shared_->store->checks.Add(
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

TEST_F(ApplianceTest, StatusAndEventsHaveAMessageBesideEachSentence) {
  const std::vector<std::string> keys = {"reason", "rolled_back", "profile_fault", "step"};
  std::vector<nlohmann::ordered_json> told;
  const auto look = [&](const nlohmann::ordered_json& json) {
    for (const std::string& key : keys) {
      if (!json.contains(key)) continue;
      ASSERT_TRUE(json.contains(key + "_message")) << json;
      if (json[key] == "") continue;
      EXPECT_EQ(MessageFromJson(json[key + "_message"], "").English(), json[key]);
      told.push_back(json[key + "_message"]);
    }
  };
  Play([&] {
    On([&] {
      shared_->notices.SetWatchers(
          [&](const std::string& line) { look(nlohmann::ordered_json::parse(line)); });
      EXPECT_FALSE(appliance_->Press(ButtonPress::kShort, kTester).empty()) << "without a sensor";
      appliance_->SetRolledBack(say::upkeep::RestartNotCarriedOut());
      const nlohmann::ordered_json status(appliance_->StatusJson());
      look(status);
      look(status["scan"]);
      look(status["sensor"]);
      EXPECT_EQ(MessagesFromJson(status["warning_messages"],
                                 status["warnings"].get<std::vector<std::string>>()),
                appliance_->WebStatus().storage.warnings);
      shared_->notices.SetWatchers({});
    });
  });
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[0]["id"], say::scan::kPlugSensorIn.name);
  EXPECT_EQ(told[1]["id"], say::upkeep::kRestartNotCarriedOut.name);
}

TEST_F(ApplianceTest, GuessesAtPasswordsAreShownByTheLightAndNothingStops) {
  Play([&] {
    MakeReady();
    On([&] {
      appliance_->SetPage(
          {.url = {}, .certificate = {}, .warnings = {}, .are_guesses_running = true});
      EXPECT_EQ(appliance_->WebStatus().light, "ready_guessed");
      appliance_->SetPage({});
      EXPECT_EQ(appliance_->WebStatus().light, "ready");
    });
  });
}

TEST_F(ApplianceTest, ARollBackIsToldByStatusAndLightUntilItIsSeen) {
  Play([&] {
    MakeReady();
    On([&] {
      EXPECT_EQ(appliance_->WebStatus().light, "ready");
      appliance_->SetRolledBack(Message::Verbatim("the machine has gone back"));
      EXPECT_EQ(appliance_->WebStatus().light, "ready_rolled_back");
      EXPECT_EQ(appliance_->WebStatus().rolled_back.English(), "the machine has gone back");
      EXPECT_THAT(appliance_->StatusJson().dump(),
                  ::testing::HasSubstr("the machine has gone back"));
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), "") << "scans go on";
      EXPECT_EQ(appliance_->WebStatus().light, "scanning");
      EXPECT_EQ(appliance_->Cancel(kTester).English(), "");
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
      const std::vector<Display> paired = shared_->store->displays.List();
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
      EXPECT_EQ(shared_->storage.fault().English(), "");
      EXPECT_TRUE(shared_->store->displays.List().empty());
    });
  });
}

}  // namespace
}  // namespace plumb
