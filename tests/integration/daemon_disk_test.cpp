// SPDX-License-Identifier: Apache-2.0
// Disks that become or are read-only under a real plumbd. Mounting needs root; without it,
// these tests are skipped.
#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <random>
#include <set>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include "daemon/records/store.hpp"
#include "tests/support/http_client.hpp"
#include "tests/support/plumbd.hpp"
#include "tests/support/process.hpp"
#include "tests/support/skip.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::HttpAnswer;
using test::HttpClient;
using test::kPassword;
using ::testing::HasSubstr;
using testing::Plumbd;

class DaemonDiskTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { testing::RenderOnce(); }

  void SetUp() override {
    if (::geteuid() != 0) PLUMB_SKIP("mounts need root");
    if (::unshare(CLONE_NEWNS) != 0 ||
        ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0) {
      // Root without CAP_SYS_ADMIN, as in a container; anything else is a fault of the test.
      ASSERT_EQ(errno, EPERM) << std::strerror(errno);
      GTEST_SKIP() << "this machine does not permit mounts";
    }
    fs::create_directories(state());
  }
  void TearDown() override {
    if (mounted_) {
      EXPECT_EQ(::umount2(state().c_str(), MNT_DETACH), 0);
    }
  }

  [[nodiscard]] fs::path state() const { return folder_ / "state"; }

  void MountMemory() {
    ASSERT_EQ(::mount("none", state().c_str(), "tmpfs", 0, "size=200m"), 0);
    mounted_ = true;
  }
  void SetReadOnly(bool read_only) const {
    ASSERT_EQ(::mount("none", state().c_str(), nullptr, MS_REMOUNT | (read_only ? MS_RDONLY : 0),
                      "size=200m"),
              0)
        << std::strerror(errno);
  }

  /// A file system that refuses every write once it has met an error, as ext4 does on a dying disk.
  /// Skips the test on a machine without loop devices or without ext4 in its kernel, and says
  /// which.
  void MountImage() {
    if (::access("/sbin/mke2fs", X_OK) != 0) PLUMB_SKIP("mke2fs is missing: install e2fsprogs");
    const fs::path image = folder_ / "disk.img";
    std::ofstream(image) << "";
    fs::resize_file(image, 600 << 20);
    const RunResult made = plumb::Run({"/sbin/mke2fs", "-q", "-F", "-t", "ext4", image});
    ASSERT_EQ(made.exit_code, 0) << made.err;
    if (const std::string why = MountAgain(); !why.empty()) GTEST_SKIP() << why;
  }
  /// The same image once more. Why not; empty: it is mounted.
  [[nodiscard]] std::string MountAgain() {
    const RunResult mount =
        plumb::Run({"/bin/mount", "-o", "loop,errors=remount-ro", folder_ / "disk.img", state()});
    if (mount.exit_code != 0)
      return "this machine does not mount ext4 on a loop device: " + mount.err;
    mounted_ = true;
    const std::string device = plumb::Run({"/bin/findmnt", "-n", "-o", "SOURCE", state()}).out;
    trigger_ = fs::path("/sys/fs/ext4") / fs::path(device.substr(0, device.find('\n'))).filename() /
               "trigger_fs_error";
    return fs::exists(trigger_) ? "" : "this kernel has no " + trigger_.string();
  }
  void Unmount() {
    ASSERT_EQ(::umount2(state().c_str(), 0), 0) << std::strerror(errno);
    mounted_ = false;
  }
  /// Of the image's bytes as they are at one moment: copied until nothing is written meanwhile.
  void CopyDisk(const fs::path& copy) const {
    const fs::path again = copy.string() + ".again";
    for (int i = 0; i < 20; ++i) {
      for (const fs::path& to : {copy, again})
        ASSERT_EQ(plumb::Run({"/bin/cp", "--sparse=always", folder_ / "disk.img", to}).exit_code,
                  0);
      if (plumb::Run({"/usr/bin/cmp", "-s", copy, again}).exit_code == 0) return;
    }
    FAIL() << "the disk is never at rest";
  }
  void BreakDisk() const { std::ofstream(trigger_) << 1; }

  /// The first account, and a reference of the demo's patient.
  static void Fill(Plumbd& plumbd) {
    plumbd.WaitForState("ready");
    (void)plumbd.MakeFirstAccount();
    plumbd.ScanOnce();
  }

  /// Nothing can be scanned, every user sees why, and stored data can still be viewed.
  static void ExpectReadable(Plumbd& plumbd) {
    HttpClient client(plumbd.port());
    const HttpAnswer health = client.Get("/health");
    EXPECT_EQ(health.status, 503);
    EXPECT_THAT(health.body, HasSubstr("Read-only file system"));
    const json refused = plumbd.Press();
    EXPECT_EQ(refused["ok"], false);
    EXPECT_THAT(refused["error"].get<std::string>(), HasSubstr("storage has failed"));
    ASSERT_EQ(client.LogIn("engineer", kPassword), 200);
    const json patients = client.Get("/api/v1/patients").json()["patients"];
    ASSERT_EQ(patients.size(), 1U) << patients.dump();
    const std::string id = patients[0]["id"].get<std::string>();
    const json references =
        client.Get("/api/v1/patients/" + id + "/references").json()["references"];
    ASSERT_EQ(references.size(), 1U) << references.dump();
    EXPECT_EQ(references[0]["approved_by"], "auto");
    EXPECT_EQ(client.Get("/api/v1/scans/000001").status, 200);
    EXPECT_EQ(client.Get("/api/v1/scans/000001/files/mesh.ply").status, 200);
    const HttpAnswer refused_patient =
        client.Post("/api/v1/patients/" + id + "/open", {{"purpose", "fraction"}, {"reason", ""}});
    EXPECT_NE(refused_patient.status, 500);
  }

  testing::TempFolder folder_;

 private:
  bool mounted_ = false;
  fs::path trigger_;
};

TEST_F(DaemonDiskTest, StartedOnAReadOnlyDiskItSaysSoAndReferencesCanBeRead) {
  MountMemory();
  {
    Plumbd plumbd(folder_.path());
    ASSERT_TRUE(plumbd.WaitUntilUp());
    Fill(plumbd);
    plumbd.Stop();
  }
  SetReadOnly(true);
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  EXPECT_THAT(plumbd.WaitForState("fault")["reason"].get<std::string>(),
              HasSubstr(state().string() + ": Read-only file system"));
  ExpectReadable(plumbd);
  SetReadOnly(false);
  plumbd.WaitForState("ready");  // by itself, within 70 s
  EXPECT_THAT(plumbd.log(), HasSubstr("safe mode has ended"));
  EXPECT_TRUE(plumbd.ScanOnce()["last_result"]["verdict"].is_string())
      << "compared with the reference";
  EXPECT_EQ(plumbd.Stop(), 0);
}

TEST_F(DaemonDiskTest, StartedOnAReadOnlyDiskAfterAPowerCutItReadsTheLogToo) {
  MountMemory();
  int newest = 0;
  {
    Plumbd plumbd(folder_.path());
    ASSERT_TRUE(plumbd.WaitUntilUp());
    Fill(plumbd);
    HttpClient client(plumbd.port());
    ASSERT_EQ(client.LogIn("engineer", kPassword), 200);
    newest = client.Get("/api/v1/audit").json()["entries"].at(0)["number"].get<int>();
    plumbd.Signal(SIGKILL);
    plumbd.Wait();
  }
  ASSERT_GT(fs::file_size(state() / "plumb.db-wal"), 0U)
      << "the login is in the log of writes only";
  SetReadOnly(true);
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("fault");
  ExpectReadable(plumbd);
  HttpClient client(plumbd.port());
  ASSERT_EQ(client.LogIn("engineer", kPassword), 200);
  // That the log was looked at was written down, too.
  EXPECT_GE(client.Get("/api/v1/audit").json()["entries"].at(0)["number"].get<int>(), newest);
  EXPECT_EQ(plumbd.Stop(), 0);
}

/// scans/ may be a disk of its own: its room counts, and whether it can be written.
TEST_F(DaemonDiskTest, ADiskOfTheScansAloneIsLookedAtToo) {
  const fs::path scans = state() / "scans";
  fs::create_directories(scans);
  ASSERT_EQ(::mount("none", scans.c_str(), "tmpfs", 0, "size=20m"), 0) << std::strerror(errno);
  {
    Plumbd plumbd(folder_.path());
    ASSERT_TRUE(plumbd.WaitUntilUp());
    const json status = plumbd.WaitForState("fault");
    EXPECT_THAT(status["reason"].get<std::string>(), HasSubstr("the disk is full"));
    EXPECT_EQ(status["light"], "fault");
    HttpClient client(plumbd.port());
    const HttpAnswer health = client.Get("/health");
    EXPECT_EQ(health.status, 503);
    EXPECT_THAT(health.body, HasSubstr("the disk is full: 20 MB are free"));
    EXPECT_THAT(plumbd.Press()["error"].get<std::string>(), HasSubstr("the disk is full"));
    EXPECT_EQ(::mount("none", scans.c_str(), nullptr, MS_REMOUNT, "size=400m"), 0);
    EXPECT_EQ(plumbd.WaitForState("ready")["light"], "ready");
    EXPECT_EQ(plumbd.Stop(), 0);
  }
  EXPECT_EQ(::mount("none", scans.c_str(), nullptr, MS_REMOUNT | MS_RDONLY, "size=20m"), 0);
  {
    Plumbd plumbd(folder_.path());
    ASSERT_TRUE(plumbd.WaitUntilUp());
    EXPECT_THAT(plumbd.WaitForState("fault")["reason"].get<std::string>(),
                HasSubstr(scans.string() + ": Read-only file system"));
    EXPECT_EQ(plumbd.Stop(), 0);
  }
  EXPECT_EQ(::umount2(scans.c_str(), MNT_DETACH), 0);
}

/// What is written where a disk was mounted lies beneath it, and is out of sight once it is back.
TEST_F(DaemonDiskTest, ADiskOfTheScansThatIsUnmountedIsNotWrittenBeneath) {
  const fs::path scans = state() / "scans", disk = folder_ / "disk";
  fs::create_directories(scans);
  fs::create_directories(disk);
  ASSERT_EQ(::mount("none", disk.c_str(), "tmpfs", 0, "size=400m"), 0) << std::strerror(errno);
  const auto mount = [&] {
    return ::mount(disk.c_str(), scans.c_str(), nullptr, MS_BIND, nullptr);
  };
  ASSERT_EQ(mount(), 0) << std::strerror(errno);
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  Fill(plumbd);
  plumbd.Press(/*is_long=*/true);
  plumbd.WaitForState("ready");
  ASSERT_EQ(::umount2(scans.c_str(), MNT_DETACH), 0) << std::strerror(errno);
  const json refused = plumbd.Press();  // before it has been noticed by itself, or after
  EXPECT_EQ(refused["ok"], false);
  EXPECT_THAT(plumbd.WaitForState("fault")["reason"].get<std::string>(),
              HasSubstr("the folder of the scans " + scans.string() + " is not the one"));
  EXPECT_TRUE(fs::is_empty(scans));
  ASSERT_EQ(mount(), 0) << std::strerror(errno);
  plumbd.WaitForState("ready");  // by itself, within 70 s
  EXPECT_TRUE(plumbd.ScanOnce()["last_result"]["verdict"].is_string());
  EXPECT_TRUE(fs::exists(disk / "000002" / "scene" / "scene.json"));
  EXPECT_EQ(plumbd.Stop(), 0);
  EXPECT_EQ(::umount2(scans.c_str(), MNT_DETACH), 0);
  EXPECT_EQ(::umount2(disk.c_str(), MNT_DETACH), 0);
}

/// As in a unit with PrivateTmp=yes: what is written to its /tmp is not where it was asked for.
TEST_F(DaemonDiskTest, ABackupIntoATemporaryFolderOfTheServiceIsRefused) {
  const fs::path hidden = folder_ / "systemd-private-1-plumbd.service-2" / "tmp";
  fs::create_directories(hidden);
  const fs::path here = folder_ / "tmp", target = here / "backup";
  fs::create_directories(here);
  const auto back_up = [&](const Plumbd& plumbd) {
    return plumb::Run({PLUMB_BINARY, "--control", plumbd.socket(), "backup", target});
  };
  ASSERT_EQ(::mount(hidden.c_str(), here.c_str(), nullptr, MS_BIND, nullptr), 0);
  {
    Plumbd plumbd(folder_.path());
    ASSERT_TRUE(plumbd.WaitUntilUp());
    const auto refused = back_up(plumbd);
    EXPECT_EQ(refused.exit_code, 1);
    EXPECT_THAT(refused.err, HasSubstr(target.string()));
    EXPECT_THAT(refused.err, HasSubstr("visible to its service only"));
    EXPECT_TRUE(fs::is_empty(hidden));
    EXPECT_EQ(plumbd.Stop(), 0);
  }
  ASSERT_EQ(::umount2(here.c_str(), 0), 0) << std::strerror(errno);
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  const auto made = back_up(plumbd);
  EXPECT_EQ(made.exit_code, 0) << made.err;
  EXPECT_TRUE(fs::exists(target / "backup.json"));
  EXPECT_EQ(plumbd.Stop(), 0);
}

TEST_F(DaemonDiskTest, ADiskThatBecomesReadOnlyWhileNobodyScansIsToldBeforeTheNextScan) {
  MountImage();
  if (IsSkipped() || HasFatalFailure()) return;
  {
    Plumbd plumbd(folder_.path());
    ASSERT_TRUE(plumbd.WaitUntilUp());
    Fill(plumbd);
    plumbd.Press(/*is_long=*/true);
    plumbd.WaitForState("ready");
    BreakDisk();
    EXPECT_THAT(plumbd.WaitForState("fault")["reason"].get<std::string>(),
                HasSubstr("Read-only file system"));
    EXPECT_THAT(plumbd.log(), HasSubstr("safe mode"));
    ExpectReadable(plumbd);
    EXPECT_EQ(plumbd.Stop(), 0);
  }
  Unmount();
  ASSERT_EQ(MountAgain(), "");
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  EXPECT_TRUE(plumbd.ScanOnce()["last_result"]["verdict"].is_string());
  EXPECT_EQ(plumbd.Stop(), 0);
}

TEST_F(DaemonDiskTest,
       ADiskThatBecomesReadOnlyDuringAScanFailsItWithTheReasonAndKeepsTheReference) {
  MountImage();
  if (IsSkipped() || HasFatalFailure()) return;
  {
    Plumbd plumbd(folder_.path());
    ASSERT_TRUE(plumbd.WaitUntilUp());
    Fill(plumbd);
    ASSERT_EQ(plumbd.Press()["ok"], true);
    plumbd.WaitForFrames(60);
    BreakDisk();
    plumbd.WaitForFrames(90);
    ASSERT_EQ(plumbd.Press()["ok"], true);
    EXPECT_THAT(plumbd.WaitForState("fault")["reason"].get<std::string>(),
                HasSubstr("ead-only file system"));
    plumbd.WaitForLog("safe mode");
    ExpectReadable(plumbd);
    EXPECT_EQ(plumbd.Stop(), 0);
  }
  Unmount();
  ASSERT_EQ(MountAgain(), "");
  Store store(state());
  EXPECT_EQ(store.recovery().broken_references, 0);
  EXPECT_EQ(store.recovery().lost_scans, 0);
  const std::vector<Scan> scans = store.scans.List("", 10);
  ASSERT_EQ(scans.size(), 2U);
  EXPECT_EQ(scans[0].outcome, ScanOutcome::kFailed);
  EXPECT_TRUE(store.references.Approved(scans[0].patient_id).has_value());
}

/// What a power cut leaves: the disk's own bytes at a moment, with the process stopped and without
/// what the kernel has not written yet. Scans that were announced by then are all there, bit for
/// bit.
TEST_F(DaemonDiskTest, ACopyOfTheDiskAtAnyMomentStartsWithEveryScanThatWasAnnounced) {
  MountImage();
  if (IsSkipped() || HasFatalFailure()) return;
  const char* wanted = std::getenv("PLUMB_CRASH_IMAGES");
  const int num_images = wanted != nullptr ? std::atoi(wanted) : 4;
  std::mt19937 random(11);
  Plumbd plumbd(folder_.path());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  Fill(plumbd);
  const fs::path copy = folder_ / "copy.img", mounted = folder_ / "copy";
  fs::create_directory(mounted);
  // Only the newest: on a disk of this size the quota keeps about twenty scans.
  constexpr std::size_t kKept = 10;
  std::set<std::string> announced;
  std::size_t num_announced = 0;
  int num_compared = 0;
  for (int round = 0; round < num_images; ++round) {
    ASSERT_EQ(plumbd.Press()["ok"], true);
    plumbd.WaitForFrames(40);
    ASSERT_EQ(plumbd.Press()["ok"], true);
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(random() % 2500);
    while (std::chrono::steady_clock::now() < end && plumbd.Status()["state"] != "result")
      std::this_thread::yield();
    num_announced +=
        announced.insert(plumbd.Status()["last_result"]["scan"].get<std::string>()).second ? 1 : 0;
    if (announced.size() > kKept) announced.erase(announced.begin());
    plumbd.Signal(SIGSTOP);
    CopyDisk(copy);
    plumbd.Signal(SIGCONT);
    ASSERT_EQ(plumb::Run({"/bin/mount", "-o", "loop", copy, mounted}).exit_code, 0);
    {
      Store store(mounted);
      EXPECT_EQ(store.recovery().lost_scans, 0);
      EXPECT_EQ(store.recovery().broken_references, 0);
      for (const std::string& scan : announced) {
        EXPECT_EQ(store.scans.Find(scan)->outcome, ScanOutcome::kDone) << scan;
        const auto files = testing::FilesBelow(mounted / "scans" / scan);
        EXPECT_GT(files.size(), 3U) << scan;
        EXPECT_TRUE(files == testing::FilesBelow(state() / "scans" / scan)) << scan;
        ++num_compared;
      }
    }
    ASSERT_EQ(::umount2(mounted.c_str(), 0), 0) << std::strerror(errno);
    const json after = plumbd.WaitFor("the end of the scan", [](const json& status) {
      return status["state"] == "result" || status["state"] == "fault";
    });
    EXPECT_EQ(after["state"], "result") << after.dump();
  }
  std::printf("%d copies of the disk, %zu scans announced, %d times looked for: all there\n",
              num_images, num_announced, num_compared);
  EXPECT_EQ(plumbd.Stop(), 0);
}

/// A kill keeps what the kernel has not written yet; a power cut does not. So the order is checked
/// in which things reach the disk.
TEST(DaemonPowerCutTest, AScanIsCalledDoneOnlyAfterAllOfItIsOnTheDisk) {
  testing::RenderOnce();
  const testing::TempFolder folder;
  Plumbd plumbd(
      folder.path(),
      {.environment = {{"LD_PRELOAD", PLUMB_SYNC_LOG}, {"PLUMB_SYNC_LOG", folder / "synced"}},
       .scenes = 2,
       .settings = [](Settings& settings) { settings.keep_recordings = true; }});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  plumbd.ScanOnce();
  ASSERT_EQ(plumbd.Sim("next-scene")["ok"], true);
  plumbd.ScanOnce();
  EXPECT_EQ(plumbd.Stop(), 0);

  std::vector<std::string> log;
  std::ifstream lines(folder / "synced");
  for (std::string line; std::getline(lines, line);) log.push_back(line);
  const auto find = [&](const std::string& line, std::ptrdiff_t from) {
    return std::find(log.begin() + from, log.end(), line) - log.begin();
  };
  const auto line_of = [](const fs::path& path) {
    struct stat status {};
    EXPECT_EQ(::stat(path.c_str(), &status), 0) << path;
    return fmt::format("fsync {} {}", status.st_ino, status.st_size);
  };
  const auto end = static_cast<std::ptrdiff_t>(log.size());
  const fs::path scans = plumbd.state() / "scans";
  std::ptrdiff_t from = 0;
  for (const std::string id : {"000001", "000002"}) {
    const std::ptrdiff_t renamed = find(
        fmt::format("rename {} {}", (scans / (".staging-" + id)).string(), (scans / id).string()),
        0);
    ASSERT_LT(renamed, end) << id;
    int num_files = 0;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(scans / id)) {
      if (entry.path().string().find("/recording") != std::string::npos) continue;
      EXPECT_LT(find(line_of(entry.path()), 0), renamed)
          << entry.path() << " was not on the disk as it is, or later";
      num_files += entry.is_regular_file() ? 1 : 0;
    }
    EXPECT_GT(num_files, 3);
    EXPECT_LT(find(line_of(scans / id), 0), renamed) << "the names in it";
    EXPECT_LT(find("syncfs", from), renamed) << "the recording";
    const auto is_of_scans = [&](const std::string& line) {
      return line.starts_with(line_of(scans).substr(0, line_of(scans).rfind(' ')));
    };
    const auto folder_synced =
        std::find_if(log.begin() + renamed, log.end(), is_of_scans) - log.begin();
    const std::ptrdiff_t row =
        find("fdatasync " + (plumbd.state() / "plumb.db-wal").string(), folder_synced);
    EXPECT_LT(row, end) << "done, in the database, after that";
    from = renamed;
  }
}

}  // namespace
}  // namespace plumb
