// SPDX-License-Identifier: Apache-2.0
// What goes wrong around a real plumbd: sensors that go and stall, signals, power cuts, full and
// broken disks.
#include <chrono>
#include <csignal>
#include <fstream>
#include <random>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include "daemon/records/store.hpp"
#include "drivers/files/unix_socket.hpp"
#include "tests/support/plumbd.hpp"
#include "tests/support/process.hpp"
#include "tests/support/sanitized.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::Plumbd;

class DaemonFaultTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { testing::RenderOnce(); }

  /// Folders of scans, hidden ones too.
  [[nodiscard]] static std::vector<std::string> ScanFolders(const fs::path& state) {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(state / "scans"))
      names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    return names;
  }

  testing::TempFolder folder_;
};

TEST_F(DaemonFaultTest, StartsWithoutASensorAndIsReadyOnceItIsPlugged) {
  Plumbd plumbd(folder_.path(), {.arguments = {"--sim-unplugged"}});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  const json status = plumbd.WaitForState("no_sensor");
  EXPECT_EQ(status["sensor"]["present"], false);
  const json refused = plumbd.Press();
  EXPECT_EQ(refused["ok"], false);
  EXPECT_THAT(refused["error"].get<std::string>(), HasSubstr("no sensor"));
  const auto plugged = std::chrono::steady_clock::now();
  plumbd.Sim("plug");
  EXPECT_EQ(plumbd.WaitForState("ready")["sensor"]["serial"], "VIRTUAL-0001");
  std::printf("plug to ready: %.0f ms\n",
              std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - plugged)
                  .count());
}

TEST_F(DaemonFaultTest, UnpluggedWhileIdleAndBackAgain) {
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  for (int round = 0; round < 3; ++round) {
    plumbd.WaitForState("ready");
    plumbd.Sim("unplug");
    plumbd.WaitForState("no_sensor");
    plumbd.Sim("plug");
  }
  plumbd.WaitForState("ready");
}

TEST_F(DaemonFaultTest, UnpluggedWhileScanningThePartialScanIsDiscarded) {
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  plumbd.Press();
  plumbd.WaitForFrames(10);
  plumbd.Sim("unplug");
  plumbd.WaitForState("no_sensor");
  EXPECT_TRUE(ScanFolders(plumbd.state()).empty());
  plumbd.Sim("plug");
  plumbd.WaitForState("ready");
  plumbd.ScanOnce();
  EXPECT_EQ(ScanFolders(plumbd.state()), std::vector<std::string>{"000002"})
      << "the number of the lost scan is not used again";
}

TEST_F(DaemonFaultTest, FramesThatStopAreAFaultWithAReasonUntilTheyComeAgain) {
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  plumbd.Sim("stall");
  const json status = plumbd.WaitForState("fault");
  EXPECT_NE(status["reason"], "");
  EXPECT_EQ(plumbd.Press()["ok"], false);
  plumbd.Sim("resume");
  plumbd.WaitForState("ready");
}

TEST_F(DaemonFaultTest, AStallWhileScanningEndsTheScanAndNotThePlumbd) {
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  plumbd.Press();
  plumbd.WaitForFrames(5);
  plumbd.Sim("stall");
  plumbd.WaitForState("fault");
  EXPECT_TRUE(ScanFolders(plumbd.state()).empty());
  plumbd.Sim("resume");
  plumbd.WaitForState("ready");
}

// The virtual sensor's threads are plumbd's, so the whole process stands still and the sensor with
// it, for longer than a sensor may be silent.
TEST_F(DaemonFaultTest, AProcessThatWasStoppedFailsTheSweepWithoutBlamingTheSensor) {
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  const auto stop_for = [&](std::chrono::milliseconds time) {
    plumbd.Signal(SIGSTOP);
    std::this_thread::sleep_for(time);  // how long it stood still is tested
    plumbd.Signal(SIGCONT);
  };
  plumbd.Press();
  plumbd.WaitForFrames(10);
  stop_for(std::chrono::milliseconds(3000));
  const std::string reason = plumbd.WaitForState("fault")["reason"];
  EXPECT_THAT(reason, HasSubstr("this program could not read sensor VIRTUAL-0001"));
  EXPECT_THAT(reason, HasSubstr("Scan again"));
  EXPECT_THAT(reason, Not(HasSubstr("unplug")));
  EXPECT_EQ(plumbd.Status()["sensor"]["present"], true);
  EXPECT_TRUE(ScanFolders(plumbd.state()).empty());
  EXPECT_EQ(plumbd.Press()["ok"], true) << "a press acknowledges";
  plumbd.WaitForState("ready");
  stop_for(std::chrono::milliseconds(3000));
  plumbd.ScanOnce();  // no frame was lost outside a scan
  EXPECT_THAT(plumbd.log(), Not(HasSubstr("unplug it")));
  EXPECT_THAT(plumbd.log(), Not(HasSubstr("the sensor does not work")));
}

TEST_F(DaemonFaultTest, ASystemBusThatIsAwayOrNeverSpeaksHoldsNothingUp) {
  const std::string silent = folder_ / "silent";
  const int listening = ListenUnix(silent);
  for (const std::string& bus : {std::string("/nonexistent/bus"), silent}) {
    Plumbd plumbd(folder_.path(),
                  {.environment = {{"DBUS_SYSTEM_BUS_ADDRESS", "unix:path=" + bus}}});
    ASSERT_TRUE(plumbd.WaitUntilUp());
    plumbd.WaitForState("ready");
    const auto begin = std::chrono::steady_clock::now();
    EXPECT_EQ(plumbd.Ask({{"command", "update-status"}}).value("installing", true), false) << bus;
    EXPECT_EQ(plumbd.Ask({{"command", "update"}, {"name", "plumb-9.0.raucb"}})["ok"], false);
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10))
        << "less than a bus may take for its first words (25 s)";
    (void)plumbd.ScanOnce();
    EXPECT_EQ(plumbd.Stop(), 0) << bus;
  }
  ::close(listening);
}

TEST_F(DaemonFaultTest, AnErrorOfTheDriverIsToldAndOverOnceItWorksAgain) {
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  plumbd.Sim("error");
  EXPECT_NE(plumbd.WaitForState("fault")["reason"], "");
  plumbd.Sim("resume");
  plumbd.WaitForState("ready");
}

TEST_F(DaemonFaultTest, APressDuringWorkingIsIgnoredAndSaidSo) {
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  plumbd.Press();
  plumbd.WaitForFrames(90);
  ASSERT_EQ(plumbd.Press()["ok"], true);
  const RunResult press = plumb::Run({PLUMB_BINARY, "--control", plumbd.socket(), "press"});
  EXPECT_EQ(press.exit_code, 0);
  EXPECT_THAT(press.out, HasSubstr("ignored"));
  plumbd.WaitForState("result");
}

TEST_F(DaemonFaultTest, ACancelledScanIsGoneSoonAndLeavesNothing) {
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  double slowest_ms = 0;
  for (const int frames : {1, 20, 60, 100}) {
    ASSERT_EQ(plumbd.Press()["ok"], true);
    plumbd.WaitForFrames(frames);
    ASSERT_EQ(plumbd.Press(/*is_long=*/true)["ok"], true);
    slowest_ms =
        std::max(slowest_ms, plumbd.WaitForState("ready")["scan"]["cancel_ms"].get<double>());
  }
  std::printf("slowest cancellation: %.0f ms\n", slowest_ms);
  testing::ExpectBelow("slowest cancellation in ms, 200 on a machine that does nothing else",
                       slowest_ms, 2000);
  EXPECT_TRUE(ScanFolders(plumbd.state()).empty());
}

TEST_F(DaemonFaultTest, AScanCancelledAtAnyMomentOfWorkingIsGoneSoonAndLeavesNothing) {
  const char* rounds_text = std::getenv("PLUMB_CANCELS");
  const int rounds = rounds_text != nullptr ? std::atoi(rounds_text) : 4;
  std::mt19937 random(11);
  Plumbd plumbd(folder_.path(), {.scenes = 2});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  plumbd.ScanOnce();  // the reference: those that follow are compared, too
  ASSERT_EQ(plumbd.Sim("next-scene")["ok"], true);
  const auto working = [&] { return plumbd.Status()["state"] == "working"; };
  double work_s = 0;
  std::size_t num_done = 1;
  std::vector<double> cancels_ms, first_frames_ms;
  for (int round = 0; round <= rounds; ++round) {
    ASSERT_EQ(plumbd.Press()["ok"], true);
    first_frames_ms.push_back(plumbd.WaitForFrames(100)["scan"]["first_frame_ms"].get<double>());
    ASSERT_EQ(plumbd.Press()["ok"], true);
    const auto begin = std::chrono::steady_clock::now();
    const auto worked_s = [&] {
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    };
    // The first one is let through, to know how long it takes.
    const double until_s =
        round == 0 ? 1e9 : work_s * std::uniform_real_distribution<>(0, 0.9)(random);
    while (working() && worked_s() < until_s) std::this_thread::yield();
    if (round == 0) work_s = worked_s();
    ASSERT_EQ(plumbd.Press(/*is_long=*/true)["ok"], true);
    const json status = plumbd.WaitFor(
        "an end", [](const json& s) { return s["state"] == "ready" || s["state"] == "result"; });
    if (status["scan"]["id"] ==
        status["last_result"]["scan"]) {  // it was done before the press came, or stored already:
                                          // then that is said
      ++num_done;
      if (status["state"] == "ready") continue;
      plumbd.WaitForLog("its result stands");
      ASSERT_EQ(plumbd.Press(/*is_long=*/true)["ok"], true);
      plumbd.WaitForState("ready");
      continue;
    }
    cancels_ms.push_back(status["scan"]["cancel_ms"].get<double>());
    EXPECT_EQ(ScanFolders(plumbd.state()).size(), num_done);
  }
  ASSERT_FALSE(cancels_ms.empty());
  std::sort(cancels_ms.begin(), cancels_ms.end());
  std::printf(
      "%zu of %d cancelled while working: median %.0f ms, slowest %.0f ms; first frame used %.0f "
      "ms after the press at most\n",
      cancels_ms.size(), rounds, cancels_ms[cancels_ms.size() / 2], cancels_ms.back(),
      *std::max_element(first_frames_ms.begin(), first_frames_ms.end()));
  testing::ExpectBelow("slowest cancellation in ms, 200 on a machine that does nothing else",
                       cancels_ms.back(), 2000);
}

TEST_F(DaemonFaultTest, SigtermWhileScanningAndWhileWorkingEndsCleanly) {
  for (const bool is_working : {false, true}) {
    {
      Plumbd plumbd(folder_.path());
      ASSERT_TRUE(plumbd.WaitUntilUp());
      plumbd.WaitForState("ready");
      plumbd.Press();
      plumbd.WaitForFrames(60);
      if (is_working) plumbd.Press();
      EXPECT_EQ(plumbd.Stop(), 0);
    }
    EXPECT_TRUE(ScanFolders(folder_ / "state").empty());
    Store store(folder_ / "state");
    EXPECT_EQ(store.recovery().interrupted_scans + store.recovery().orphaned_folders, 0)
        << "nothing was left to repair";
    EXPECT_EQ(store.scans.List("", 1).at(0).outcome, ScanOutcome::kCancelled);
  }
}

/// What must hold of a state folder whenever plumbd was killed and its store opened again.
void ExpectConsistent(const fs::path& state) {
  Store store(state);
  EXPECT_EQ(store.recovery().lost_scans, 0);
  EXPECT_EQ(store.recovery().broken_references, 0) << "the approved reference must survive";
  std::vector<std::string> with_folder;
  for (const Scan& scan : store.scans.List("", 10000)) {
    EXPECT_NE(scan.outcome, ScanOutcome::kRunning);
    EXPECT_EQ(scan.outcome == ScanOutcome::kDone, !scan.folder.empty()) << scan.id;
    if (!scan.folder.empty()) with_folder.push_back(scan.id);
    if (!scan.reference_id.empty() && scan.outcome == ScanOutcome::kDone) {
      EXPECT_TRUE(fs::exists(scan.folder / "result" / "result.json")) << scan.id;
    }
  }
  std::sort(with_folder.begin(), with_folder.end());
  std::vector<std::string> folders;
  for (const auto& entry : fs::directory_iterator(state / "scans"))
    folders.push_back(entry.path().filename());
  std::sort(folders.begin(), folders.end());
  EXPECT_EQ(folders, with_folder);
}

TEST_F(DaemonFaultTest, KilledAtAnyMomentNothingIsHalf) {
  const char* rounds_text = std::getenv("PLUMB_KILL_ROUNDS");
  const int rounds = rounds_text != nullptr ? std::atoi(rounds_text) : 3;
  std::mt19937 random(7);
  {
    Plumbd plumbd(folder_.path());
    ASSERT_TRUE(plumbd.WaitUntilUp());
    plumbd.WaitForState("ready");
    plumbd.ScanOnce();  // the reference
    plumbd.Signal(SIGKILL);
    EXPECT_EQ(plumbd.Wait(), -SIGKILL);
  }
  ExpectConsistent(folder_ / "state");
  for (int round = 0; round < rounds; ++round) {
    {
      Plumbd plumbd(folder_.path());
      ASSERT_TRUE(plumbd.WaitUntilUp());
      plumbd.WaitForState("ready");
      plumbd.Press();
      plumbd.WaitForFrames(static_cast<int>(random() % 60) + 40);
      // Half of the rounds die while frames come, half while their result is made and saved.
      if (random() % 4 != 0) plumbd.Press();
      const auto delay = std::chrono::milliseconds(random() % 2500);
      const auto end = std::chrono::steady_clock::now() + delay;
      while (std::chrono::steady_clock::now() < end && plumbd.Status()["state"] != "result")
        std::this_thread::yield();
      plumbd.Signal(SIGKILL);
      EXPECT_EQ(plumbd.Wait(), -SIGKILL);
    }
    ExpectConsistent(folder_ / "state");
  }
  Store store(folder_ / "state");
  const std::vector<Scan> scans = store.scans.List("", 10000);
  const auto num_done = std::count_if(
      scans.begin(), scans.end(), [](const Scan& s) { return s.outcome == ScanOutcome::kDone; });
  std::printf("%d rounds: %d scans done, %zu begun\n", rounds, static_cast<int>(num_done),
              scans.size());
}

TEST_F(DaemonFaultTest, AFullDiskFailsTheScanWithAReasonAndKeepsTheReference) {
  {
    Plumbd plumbd(folder_.path());
    ASSERT_TRUE(plumbd.WaitUntilUp());
    plumbd.WaitForState("ready");
    plumbd.ScanOnce();
    EXPECT_EQ(plumbd.Stop(), 0);
  }
  {
    Plumbd plumbd(folder_.path(),
                  {.max_file_bytes = 300'000});  // the database still fits, a scene does not
    ASSERT_TRUE(plumbd.WaitUntilUp());
    plumbd.WaitForState("ready");
    plumbd.Press();
    plumbd.WaitForFrames(90);
    plumbd.Press();
    EXPECT_THAT(plumbd.WaitForState("fault")["reason"].get<std::string>(),
                HasSubstr("cannot write"));
    EXPECT_EQ(plumbd.Press()["ok"], true) << "a press acknowledges";
    plumbd.WaitForState("ready");
    EXPECT_EQ(plumbd.Stop(), 0);
  }
  ExpectConsistent(folder_ / "state");
}

TEST_F(DaemonFaultTest, AStateFolderThatCannotBeWrittenIsSafeModeWithAReason) {
  const bool is_root =
      ::geteuid() == 0;  // root ignores file modes: use a folder where even root cannot write
  const fs::path state = is_root ? fs::path("/proc/plumb-state") : folder_ / "locked" / "state";
  if (!is_root) {
    fs::create_directories(state.parent_path());
    fs::permissions(state.parent_path(), fs::perms::owner_read | fs::perms::owner_exec);
  }
  Plumbd plumbd(folder_.path(), {.state = state});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  EXPECT_THAT(plumbd.WaitForState("fault")["reason"].get<std::string>(), HasSubstr(state.string()));
  EXPECT_EQ(plumbd.Press()["ok"], false);
  EXPECT_EQ(plumbd.Stop(), 0);
}

TEST_F(DaemonFaultTest, ACorruptDatabaseIsSafeModeAndTouchesNothing) {
  fs::create_directories(folder_ / "state" / "scans" / "000001" / "scene");
  std::ofstream(folder_ / "state" / "plumb.db") << std::string(50000, 'x');
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  const json status = plumbd.WaitFor("fault and a sensor", [](const json& s) {
    return s["state"] == "fault" && s["sensor"]["present"] == true;
  });
  EXPECT_THAT(status["reason"].get<std::string>(), HasSubstr("damaged"));
  EXPECT_THAT(plumbd.Press()["error"].get<std::string>(), HasSubstr("storage"));
  EXPECT_EQ(plumbd.Stop(), 0);
  EXPECT_TRUE(fs::exists(folder_ / "state" / "scans" / "000001" / "scene"));
}

TEST_F(DaemonFaultTest, DamageInAFolderWhoseNameIsNoUtf8IsToldAndNotTheEnd) {
  const fs::path state = folder_ /
                         "archivo_se\xF1"
                         "al";
  fs::create_directories(state);
  std::ofstream(state / "plumb.db") << std::string(50000, 'x');
  Plumbd plumbd(folder_.path(), {.state = state});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  EXPECT_THAT(plumbd.WaitForState("fault")["reason"].get<std::string>(), HasSubstr("damaged"));
  EXPECT_EQ(plumbd.Press()["ok"], false) << "a refusal that quotes the reason";
  EXPECT_EQ(plumbd.Status()["state"], "fault") << "still up";
  EXPECT_EQ(plumbd.Stop(), 0);
}

TEST_F(DaemonFaultTest, WhatItStoresIsForItsAccountAndItsGroupWhateverTheUmask) {
  const mode_t before = ::umask(0);
  {  // of an older version
    Store store(folder_ / "state");
    (void)testing::StoreScan(store, store.patients.Add(testing::kAnna, "P", ""));
    fs::permissions(folder_ / "state", fs::perms(0755));
  }
  Plumbd plumbd(folder_.path());
  ::umask(before);
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  (void)plumbd.ScanOnce();
  EXPECT_EQ(plumbd.Stop(), 0);
  const fs::path state = plumbd.state();
  EXPECT_EQ(fs::status(state).permissions(), fs::perms(0750));
  int num_files = 0;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(state)) {
    const auto mode = static_cast<unsigned>(entry.symlink_status().permissions());
    EXPECT_EQ(mode & ~(entry.is_directory() ? 0750U : 0640U), 0U) << entry.path();
    num_files += entry.is_regular_file() ? 1 : 0;
  }
  EXPECT_GT(num_files, 5);
}

TEST_F(DaemonFaultTest, ASecondPlumbdOnTheSameFolderIsSafeModeAndTheFirstGoesOn) {
  // The second one may take long to start.
  Plumbd first(folder_.path(),
               {.settings = [](Settings& settings) { settings.auto_stop_s = 100; }});
  ASSERT_TRUE(first.WaitUntilUp());
  first.WaitForState("ready");
  ASSERT_EQ(first.Press()["ok"], true);
  first.WaitForFrames(20);
  const testing::TempFolder other;
  Plumbd second(other.path(), {.state = first.state()});
  ASSERT_TRUE(second.WaitUntilUp());
  EXPECT_THAT(second.WaitForState("fault")["reason"].get<std::string>(),
              HasSubstr("another plumbd"));
  EXPECT_EQ(second.Stop(), 0);
  EXPECT_EQ(first.Status()["state"], "scanning");
  EXPECT_EQ(first.Press()["ok"], true);
  EXPECT_EQ(first.WaitForState("result")["last_result"]["is_reference"], true)
      << "its staging folder is still there";
}

TEST_F(DaemonFaultTest, ManyShortScansLeaveNoThreadsDescriptorsOrMemoryBehind) {
  const char* rounds_text = std::getenv("PLUMB_SHORT_SCANS");
  const int rounds = rounds_text != nullptr ? std::atoi(rounds_text) : 15;
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  int descriptors = 0, threads = 0;
  long memory_kb = 0;
  for (int round = 0; round < rounds; ++round) {
    ASSERT_EQ(plumbd.Press()["ok"], true);
    plumbd.WaitForFrames(3);
    ASSERT_EQ(plumbd.Press(/*is_long=*/true)["ok"], true);
    plumbd.WaitForState("ready");
    if (round != rounds / 3) continue;  // pools and caches have filled by then
    descriptors = plumbd.num_descriptors();
    threads = plumbd.num_threads();
    memory_kb = plumbd.resident_kb();
  }
  // The connection that asked last may be open for a moment yet.
  const auto deadline =
      std::chrono::steady_clock::now() + std::chrono::seconds(5 * testing::kSlowness);
  while (plumbd.num_descriptors() > descriptors && std::chrono::steady_clock::now() < deadline)
    std::this_thread::yield();
  std::printf("%d scans: descriptors %d -> %d, threads %d -> %d, memory %ld -> %ld kB\n", rounds,
              descriptors, plumbd.num_descriptors(), threads, plumbd.num_threads(), memory_kb,
              plumbd.resident_kb());
  EXPECT_LE(plumbd.num_descriptors(), descriptors);
  EXPECT_LE(plumbd.num_threads(), threads);
  testing::ExpectBelow("memory in kB; the allocator's pools move by some megabytes",
                       static_cast<double>(plumbd.resident_kb()),
                       static_cast<double>(memory_kb + 30'000));
}

TEST_F(DaemonFaultTest, SighupTakesAGoodConfigurationAndKeepsTheOldOneForABadOne) {
  const fs::path config = folder_ / "plumb.toml";
  std::ofstream(config) << "[appliance]\nwarm_up_min = 20\n";
  Plumbd plumbd(folder_.path(), {.arguments = {"--config", config}});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  std::ofstream(config) << "[appliance]\nwarm_up_min = -1\n";
  plumbd.Signal(SIGHUP);
  plumbd.WaitForLog("plumb.toml:2");
  std::ofstream(config) << "[reconstruct]\npreset = \"paper\"\n[markers]\nlength_m = "
                           "0.05\n[web]\nhost_names = [\"scan.example\"]\n";
  plumbd.Signal(SIGHUP);
  plumbd.WaitForLog("only after a restart: markers.length_m, web.host_names");
  const std::string scan = plumbd.ScanOnce()["last_result"]["scan"];
  EXPECT_THAT(ReadTextFile(plumbd.state() / "scans" / scan / "scene" / "scene.json", 1 << 20),
              HasSubstr("\"preset\": \"paper\""))
      << "the new preset holds";
  EXPECT_THAT(plumbd.notifications(), HasSubstr("RELOADING=1"));
}

TEST_F(DaemonFaultTest, TheWatchdogIsFedWhileItScansAndAfter) {
  Plumbd plumbd(folder_.path(), {.environment = {{"WATCHDOG_USEC", "300000"}}});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  const auto fed = [&] {
    const std::string reported = plumbd.notifications();
    int count = 0;
    for (std::size_t at = reported.find("WATCHDOG=1"); at != std::string::npos;
         at = reported.find("WATCHDOG=1", at + 1))
      ++count;
    return count;
  };
  plumbd.Press();
  plumbd.WaitForFrames(20);
  const int before = fed();
  plumbd.WaitFor("more food", [&](const json&) { return fed() >= before + 5; });
  EXPECT_EQ(plumbd.Stop(), 0);
}

TEST_F(DaemonFaultTest, AClockThatStepsDisturbsNoTimer) {
  // Wall-clock time comes from a library loaded before the others, which adds what a file says.
  std::ofstream(folder_ / "offset") << 0;
  Plumbd plumbd(folder_.path(),
                {.environment = {{"LD_PRELOAD", PLUMB_CLOCK_STEP},
                                 {"PLUMB_CLOCK_OFFSET", folder_ / "offset"}},
                 .settings = [](Settings& settings) { settings.auto_stop_s = 1.5; }});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  plumbd.Press();
  plumbd.WaitForFrames(30);
  std::ofstream(folder_ / "offset") << -86400;
  plumbd.WaitForFrames(60);
  std::ofstream(folder_ / "offset") << 86400 * 30;
  EXPECT_EQ(plumbd.WaitForState("result")["last_result"]["is_reference"], true)
      << "neither cut short nor without end";
  std::ofstream(folder_ / "offset") << -86400;
  plumbd.ScanOnce();
  EXPECT_EQ(plumbd.Stop(), 0);
  Store store(folder_ / "state");
  const std::vector<Scan> scans = store.scans.List("", 10);
  ASSERT_EQ(scans.size(), 2U);
  EXPECT_LT(scans[0].started_at, scans[1].finished_at) << "the clock did step";
  EXPECT_EQ(scans[0].id, "000002") << "and the order is that of the scans all the same";
}

TEST_F(DaemonFaultTest, NonsenseAtTheControlSocketCostsOnlyItsOwnConnection) {
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  for (const std::string& text :
       {std::string("\n"), std::string("{}\n"), std::string("[[[[[[[[\n"),
        std::string(100'000, 'a'), std::string("{\"command\":\"sim\",\"action\":\"explode\"}\n"),
        std::string("\0\xFF\xFE\n", 4)}) {
    const int fd = ConnectUnix(plumbd.socket());
    (void)::send(fd, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    char buffer[512] = {};
    EXPECT_GT(::recv(fd, buffer, sizeof(buffer) - 1, 0), 0) << text.substr(0, 20);
    EXPECT_THAT(buffer, HasSubstr("\"ok\":false"));
    ::close(fd);
  }
  std::vector<int> silent;
  for (int i = 0; i < 100; ++i)
    silent.push_back(ConnectUnix(plumbd.socket()));  // more than it keeps
  for (const int fd : silent) ::close(fd);
  plumbd.WaitFor("its answer", [](const json& status) { return status.contains("state"); });
}

TEST_F(DaemonFaultTest, AFloodAtTheControlSocketNeitherGrowsPlumbdNorKeepsOthersOut) {
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  const auto flood = [&](std::size_t bytes) {
    const std::string requests = "{\"command\":\"status\"}\n{\"command\":\"nonsense\"}\n";
    for (std::size_t sent = 0; sent < bytes;) {
      const int fd = ConnectUnix(plumbd.socket());
      for (ssize_t count = 1; count > 0 && sent < bytes; sent += requests.size())
        count = ::send(fd, requests.data(), requests.size(), MSG_NOSIGNAL);
      ::close(fd);
    }
  };
  // Together 400 000 requests: what was kept of each, were it 100 bytes, would be 40 MB.
  constexpr std::size_t kBytes = 3 << 20;
  flood(kBytes);  // what it keeps for its work is there after the first one
  const long before = plumbd.resident_kb();
  std::vector<std::jthread> floods;
  for (int i = 0; i < 3; ++i) floods.emplace_back([&] { flood(kBytes); });
  for (int i = 0; i < 20; ++i)
    plumbd.WaitFor("its answer", [](const json& status) { return status.contains("state"); });
  floods.clear();
  testing::ExpectBelow("memory in kB; the allocator's pools move by some megabytes",
                       static_cast<double>(plumbd.resident_kb()),
                       static_cast<double>(before + 30'000));
}

}  // namespace
}  // namespace plumb
