// SPDX-License-Identifier: Apache-2.0
// Backups and what is restored of them.
#include "daemon/archive/backup.hpp"

#include <atomic>
#include <chrono>
#include <fstream>
#include <functional>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "daemon/archive/store_backup.hpp"
#include "tests/support/full_disk.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/archive/archive_content.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using testing::FilesBelow;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kAnna;
using testing::MessageOf;
using testing::PlanAndApprove;
using testing::StoreScan;

class BackupTest : public ::testing::Test {
 protected:
  BackupTest() {
    Store store(state());
    patient_ = store.patients.Add(kAnna, "P", "thorax");
    reference_ = StoreScan(store, patient_);
    (void)PlanAndApprove(store, store.references.Add(kAnna, reference_, "", {}));
    for (int i = 0; i < 3; ++i) scan_ = StoreScan(store, patient_);
    fs::create_directories(state() / "calibration");
    WriteWholeFile(state() / "calibration" / "S1.yaml", std::string_view("fx: 1"));
    fs::create_directories(state() / "sensor-profiles" / "S1");
    WriteWholeFile(state() / "sensor-profiles" / "S1" / "000001.profile", std::string_view("1"));
    fs::create_directories(state() / "set-aside" / "000099" / "scene");
    WriteWholeFile(state() / "set-aside" / "000099" / "scene" / "scene.json",
                   std::string_view("{}"));
  }
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  [[nodiscard]] fs::path backup() const { return folder_ / "backup"; }
  [[nodiscard]] fs::path restored() const { return folder_ / "restored"; }

  /// Without the database, whose pages a start changes, and the note of a restore.
  static auto FilesOf(const fs::path& folder) { return testing::FilesOfState(folder); }

  testing::TempFolder folder_;
  std::string patient_, reference_, scan_;
};

TEST_F(BackupTest, WhatIsRestoredIsByteIdentical) {
  const BackupReport made = BackUpStopped(state(), backup());
  EXPECT_EQ(made.scans, 4U);
  EXPECT_EQ(made.files, 1U + 4 * 7 + 3);
  EXPECT_THAT(made.problems, IsEmpty());
  const BackupReport report = RestoreBackup(backup(), restored());
  EXPECT_EQ(report.scans, 4U);
  EXPECT_EQ(report.files, made.files);
  EXPECT_EQ(report.bytes, made.bytes);
  EXPECT_EQ(FilesOf(restored()), FilesOf(state()));
  EXPECT_EQ(FilesBelow(restored()).at("plumb.db"), FilesBelow(backup()).at("plumb.db"));
  Store store(restored());
  EXPECT_EQ(store.recovery().lost_scans + store.recovery().foreign_folders, 0);
  EXPECT_EQ(store.references.Approved(patient_)->scan_id, reference_);
  for (const Scan& scan : store.scans.List(patient_, 100))
    EXPECT_EQ(store.integrity.Check(scan.id, false).English(), "");
  EXPECT_EQ(store.audit.FirstBroken(), std::nullopt);
}

TEST_F(BackupTest, IsMadeWhileScansGoOnAndHoldsOneMoment) {
  Store store(state());
  std::jthread scanning([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) (void)StoreScan(store, patient_);
  });
  for (int round = 0; round < 5; ++round) {
    const BackupReport made = StoreBackup(store).Make(kAnna, backup());  // replaces the one before
    EXPECT_THAT(made.problems, IsEmpty());
    const fs::path target = folder_ / fmt::format("restored-{}", round);
    EXPECT_EQ(RestoreBackup(backup(), target).scans, made.scans);
    Store copy(target);
    EXPECT_EQ(copy.recovery().lost_scans + copy.recovery().foreign_folders, 0);
    for (const Scan& scan : copy.scans.List(patient_, 1000)) {
      if (scan.outcome != ScanOutcome::kDone) continue;
      EXPECT_EQ(copy.integrity.Check(scan.id, false).English(), "") << scan.id;
    }
  }
  scanning.request_stop();
  scanning.join();
  EXPECT_EQ(store.audit.Find({0, 1000}).back().action, "patient.add");
}

TEST_F(BackupTest, NothingIsRemovedWhileItIsMade) {
  Store store(state());
  std::atomic<int> made = 0;
  std::jthread backing_up([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      EXPECT_THAT(StoreBackup(store).Make(kAnna, backup()).problems, IsEmpty());
      ++made;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));  // removals have their turn
    }
  });
  std::set<int> refused_in;  // the backups during which it was
  int removed = 0;
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while ((refused_in.size() < 5 || removed < 3) && std::chrono::steady_clock::now() < end) {
    const int during = made;
    try {
      (void)store.removal.KeepWithinQuota(0, testing::kAtOnce);
      ++removed;
      // Something for the next one to take, and no more: backups take the longer, the more there
      // is.
      for (int i = 0; i < 3; ++i) (void)StoreScan(store, patient_);
    } catch (const StoreRefusal& refusal) {
      EXPECT_THAT(refusal.what(), HasSubstr("backup"));
      refused_in.insert(during);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  backing_up.request_stop();
  backing_up.join();
  EXPECT_GE(refused_in.size(), 5U);
  EXPECT_GE(removed, 3) << "nothing could be removed between two backups either";
  const fs::path target = restored();
  (void)StoreBackup(store).Make(kAnna, backup());
  (void)RestoreBackup(backup(), target);
  EXPECT_EQ(Store(target).recovery().lost_scans, 0);
}

TEST_F(BackupTest, TellsWhatIsNotAsItWasStoredAndKeepsTheRest) {
  WriteWholeFile(state() / "scans" / scan_ / "scene" / "cloud.ply", std::string_view("changed"));
  fs::remove(state() / "scans" / scan_ / "scene" / "mesh.ply");
  const BackupReport made = BackUpStopped(state(), backup());
  EXPECT_THAT(EnglishTexts(made.problems),
              ElementsAre(AllOf(HasSubstr(scan_), HasSubstr("cloud.ply"), HasSubstr("not what")),
                          AllOf(HasSubstr(scan_), HasSubstr("mesh.ply"), HasSubstr("missing"))));
  const auto about = nlohmann::json::parse(FilesBelow(backup()).at("backup.json"));
  EXPECT_EQ(about.at("problem_messages").at(1).at("id"), "backup.scan_file_missing");
  EXPECT_EQ(about.at("problems").at(1), made.problems.at(1).English());
  EXPECT_EQ(made.files, 1U + 4 * 7 - 1 + 3);
  (void)RestoreBackup(backup(), restored());
  Store store(restored());
  EXPECT_FALSE(store.scans.Find(scan_)->failure.empty()) << "restored as damaged as it was";
}

TEST_F(BackupTest, WhatDamagesTheOriginalLeavesTheBackupWhole) {
  (void)BackUpStopped(state(), backup());
  const fs::path file = fs::path("scans") / scan_ / "scene" / "cloud.ply";
  {
    std::fstream original(state() / file, std::ios::in | std::ios::out | std::ios::binary);
    original.put('X');
  }
  fs::resize_file(state() / "scans" / scan_ / "scene" / "scene.json", 1);
  EXPECT_EQ(fs::hard_link_count(backup() / file), 1U);
  const BackupReport report = RestoreBackup(backup(), restored());
  EXPECT_EQ(report.scans, 4U);
  Store store(restored());
  EXPECT_EQ(store.integrity.Check(scan_, false).English(), "");
  EXPECT_NE(Store(state()).integrity.Check(scan_, false).English(), "")
      << "the original is what was damaged";
}

TEST_F(BackupTest, ADamagedBackupRestoresNothingAndSaysWhich) {
  (void)BackUpStopped(state(), backup());
  const auto files = FilesBelow(backup());
  for (const auto& [name, content] : files) {
    SCOPED_TRACE(name);
    fs::remove(backup() / name);  // the store's own file has this name too
    WriteWholeFile(backup() / name,
                   content.substr(0, content.size() / 2) + "!" +
                       content.substr(std::min(content.size(), content.size() / 2 + 1)));
    EXPECT_THAT(MessageOf<DataError>([&] { (void)RestoreBackup(backup(), restored()); }),
                HasSubstr("nothing was restored"));
    EXPECT_FALSE(fs::exists(restored()));
    fs::remove(backup() / name);
    EXPECT_THAT(MessageOf<DataError>([&] { (void)RestoreBackup(backup(), restored()); }),
                AllOf(HasSubstr(name), HasSubstr("nothing was restored")));
    WriteWholeFile(backup() / name, content);
  }
  EXPECT_EQ(RestoreBackup(backup(), restored()).files, files.size() - 2);
}

// Before the first file is copied, so that the message counts all of them.
TEST_F(BackupTest, EveryDamagedFileIsCountedBeforeAnyIsCopied) {
  const BackupReport made = BackUpStopped(state(), backup());
  for (const std::string& scan : {reference_, scan_})
    WriteWholeFile(backup() / "scans" / scan / "scene" / "cloud.ply", std::string_view("changed"));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)RestoreBackup(backup(), restored()); }),
              HasSubstr(fmt::format("2 of {} files are damaged (scans/{}/scene/cloud.ply",
                                    made.files, reference_)));
  EXPECT_FALSE(fs::exists(restored()));
}

TEST_F(BackupTest, APathOutsideIsRefused) {
  (void)BackUpStopped(state(), backup());
  const auto files = FilesBelow(backup());
  for (const char* path : {"../evil", "/etc/evil", "scans/../../evil", "other/file", "scans//x",
                           "plumb.db/x", "scans/a\tb", ""}) {
    const std::string sums = files.at("SHA256SUMS") + std::string(64, '0') + "  " + path + "\n";
    WriteWholeFile(backup() / "SHA256SUMS", sums);
    std::string about = files.at("backup.json");
    const std::size_t at = about.find("\"sha256sums\": \"") + 15;
    about.replace(at, 64, DigestOfFile(backup(), "SHA256SUMS").sha256);
    WriteWholeFile(backup() / "backup.json", about);
    EXPECT_THAT(MessageOf<DataError>([&] { (void)RestoreBackup(backup(), restored()); }),
                HasSubstr("SHA256SUMS"))
        << path;
  }
  EXPECT_FALSE(fs::exists(folder_ / "evil"));
}

TEST_F(BackupTest, IsNotMadeInsideTheFolderThatItIsOf) {
  Store store(state());
  fs::create_directory_symlink(state(), folder_ / "link");
  for (const fs::path& target : {state(), state() / "set-aside" / "backup", state() / "scans" / "9",
                                 folder_ / "link" / "backup", state() / "x" / ".." / "backup"}) {
    EXPECT_THAT(
        MessageOf<std::invalid_argument>([&] { (void)StoreBackup(store).Make(kAnna, target); }),
        HasSubstr("inside the state folder"))
        << target;
  }
  EXPECT_NO_THROW((void)StoreBackup(store).Make(kAnna, folder_ / "state-backup"));
}

TEST_F(BackupTest, IsRestoredIntoAnEmptyFolderOnly) {
  (void)BackUpStopped(state(), backup());
  EXPECT_THAT(MessageOf<std::invalid_argument>([&] { (void)RestoreBackup(backup(), state()); }),
              HasSubstr("empty"));
  fs::create_directories(restored() / ".restore" / "scans");  // an interrupted one
  EXPECT_EQ(RestoreBackup(backup(), restored()).scans, 4U);
  EXPECT_FALSE(fs::exists(restored() / ".restore"));
}

TEST_F(BackupTest, WhatARestoreReplacesIsMovedAsideAndWhole) {
  (void)BackUpStopped(state(), backup());
  const auto saved = FilesOf(state());
  WriteWholeFile(state() / "page-key.pem", std::string_view("key"));
  WriteWholeFile(state() / "page-authority.pem", std::string_view("authority"));
  // Beside a database that does not know its key, it would pair a removed display again.
  WriteWholeFile(state() / "provisioned-display", std::string_view("hash name"));
  {
    Store store(state());
    scan_ = StoreScan(store, patient_);
  }
  auto before = FilesBelow(state());
  before.erase("last-scan");  // it stays, too
  const BackupReport report = RestoreOver(backup(), state());
  EXPECT_EQ(report.scans, 4U);
  EXPECT_EQ(report.replaced, state() / "before-restore-1");
  auto aside = FilesBelow(report.replaced);
  EXPECT_EQ(aside.size() + 3, before.size());
  EXPECT_FALSE(fs::exists(backup() / "rows.key"));
  aside["page-key.pem"] = "key";
  aside["page-authority.pem"] = "authority";
  aside["rows.key"] = before.at("rows.key");
  EXPECT_EQ(aside, before) << "all but the keys, which stay";
  EXPECT_TRUE(fs::exists(state() / "page-key.pem"));
  EXPECT_FALSE(fs::exists(state() / "provisioned-display"));
  EXPECT_FALSE(fs::exists(state() / ".recovery"));
  {
    Store store(state());
    EXPECT_EQ(store.scans.List(patient_, 100).size(), 4U);
    EXPECT_EQ(store.audit.Find({0, 10, "backup.restore"}).size(), 1U);
    EXPECT_EQ(store.recovery().lost_scans + store.recovery().foreign_folders, 0);
  }
  EXPECT_EQ(RestoreOver(backup(), state()).replaced, state() / "before-restore-2");
  EXPECT_EQ(FilesBelow(report.replaced).size() + 3, before.size()) << "the first is as it was";
  auto now = FilesOf(state());
  std::erase_if(now, [](const auto& entry) {
    return entry.first.starts_with("before-restore") || entry.first.starts_with("page-");
  });
  EXPECT_EQ(now, saved);
}

TEST_F(BackupTest, ARestoreOverWhatIsStoredChangesNothingWithADamagedBackupOrARunningStore) {
  (void)BackUpStopped(state(), backup());
  {
    const Store store(state());
    EXPECT_THROW((void)RestoreOver(backup(), state()), DatabaseBusy);
  }
  const auto before = FilesBelow(state());
  WriteWholeFile(backup() / "scans" / scan_ / "scene" / "cloud.ply", std::string_view("changed"));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)RestoreOver(backup(), state()); }),
              HasSubstr("nothing was restored"));
  EXPECT_EQ(FilesBelow(state()), before);
  EXPECT_FALSE(fs::exists(state() / "before-restore-1"));
}

TEST_F(BackupTest, ADamagedDatabaseAndAnEmptyFolderAreRestoredOver) {
  (void)BackUpStopped(state(), backup());
  WriteWholeFile(state() / "plumb.db", std::string_view("no database"));
  EXPECT_EQ(RestoreOver(backup(), state()).scans, 4U);
  EXPECT_EQ(Store(state()).scans.List(patient_, 100).size(), 4U);
  fs::create_directory(restored());
  EXPECT_EQ(RestoreOver(backup(), restored()).replaced, "") << "there was nothing";
  EXPECT_FALSE(fs::exists(restored() / "before-restore-1"));
  EXPECT_EQ(Store(restored()).scans.List(patient_, 100).size(), 4U);
}

/// What somebody with a right sum for everything may have put into it.
TEST_F(BackupTest, ADatabaseThatPlumbdCannotStartWithMovesNothing) {
  const auto with = [&](const std::function<void(const fs::path& database)>& change) {
    fs::remove_all(backup());
    (void)BackUpStopped(state(), backup());
    const fs::path database = backup() / "plumb.db";
    const std::string sum = DigestOfFile(backup(), "plumb.db").sha256;
    const std::string all = DigestOfFile(backup(), "SHA256SUMS").sha256;
    fs::permissions(database, fs::perms::owner_write, fs::perm_options::add);
    change(database);
    for (const char* beside : {"plumb.db-wal", "plumb.db-shm", "plumb.db-mark", "plumb.db-seals"})
      fs::remove(backup() / beside);
    const auto replace = [&](const char* name, const std::string& from, const std::string& to) {
      std::string text = ReadTextFile(backup() / name, 1U << 20U);
      const std::size_t at = text.find(from);
      ASSERT_NE(at, std::string::npos);
      fs::permissions(backup() / name, fs::perms::owner_write, fs::perm_options::add);
      WriteWholeFile(backup() / name, text.replace(at, from.size(), to));
    };
    replace("SHA256SUMS", sum, DigestOfFile(backup(), "plumb.db").sha256);
    replace("backup.json", all, DigestOfFile(backup(), "SHA256SUMS").sha256);
  };
  const auto why_not = [&](const std::function<void(const fs::path& database)>& change) {
    with(change);
    return MessageOf<DataError>([&] { (void)RestoreOver(backup(), state()); });
  };
  const auto run = [](const std::string& sql) {
    return [sql](const fs::path& database) {
      Database(database, Database::Access::kReadWrite).Execute(sql);
    };
  };
  const auto before = FilesOf(state());
  EXPECT_THAT(why_not(run("PRAGMA user_version = 99; DELETE FROM settings")), HasSubstr("99"));
  EXPECT_THAT(why_not(run("PRAGMA user_version = 5")), HasSubstr("5"));
  EXPECT_THAT(why_not(run("PRAGMA foreign_keys = OFF; DROP TABLE checks")), HasSubstr("checks"));
  EXPECT_THAT(why_not(run("PRAGMA foreign_keys = OFF; DELETE FROM scans WHERE id = 1")),
              HasSubstr("does not know scan 000001"));
  EXPECT_THAT(why_not([](const fs::path& database) { fs::resize_file(database, 0); }),
              HasSubstr("0"));
  EXPECT_EQ(FilesOf(state()), before);
  EXPECT_FALSE(fs::exists(state() / "before-restore-1"));
  with([](const fs::path&) {});
  EXPECT_EQ(RestoreOver(backup(), state()).scans, 4U) << "as it was made";
}

TEST_F(BackupTest, ARestoreWithoutRoomLeavesNothing) {
  WriteWholeFile(state() / "scans" / scan_ / "scene" / "large.ply", std::string(3'000'000, 'x'));
  (void)BackUpStopped(state(), backup());
  const auto is_refused = [&](const std::function<void()>& restore) {
    return testing::WriteOnFullDisk(2'000'000, restore) == testing::WriteOutcome::kIoError;
  };
  EXPECT_TRUE(is_refused([&] { (void)RestoreBackup(backup(), restored()); }));
  EXPECT_FALSE(fs::exists(restored()));
  fs::create_directory(restored());
  EXPECT_TRUE(is_refused([&] { (void)RestoreBackup(backup(), restored()); }));
  EXPECT_TRUE(fs::is_empty(restored()));
  EXPECT_TRUE(is_refused([&] { (void)RestoreOver(backup(), state()); }));
  EXPECT_FALSE(fs::exists(state() / ".recovery"));
  EXPECT_EQ(RestoreBackup(backup(), restored()).scans, 4U);
}

TEST_F(BackupTest, ARestoreInterruptedBetweenOldAndNewIsSafeModeUntilItIsRepeated) {
  (void)BackUpStopped(state(), backup());
  (void)RestoreBackup(backup(), restored() / ".recovery");  // all is unpacked, nothing in place
  fs::create_directory(restored() / "before-restore-1");    // and the old moved aside
  for (int start = 1; start <= 2; ++start) {
    EXPECT_THAT(MessageOf<DatabaseCorrupt>([&] { const Store store(restored()); }),
                HasSubstr("was interrupted: restore it again"))
        << start;
  }
  EXPECT_EQ(RestoreOver(backup(), restored()).scans, 4U);
  EXPECT_EQ(Store(restored()).scans.List(patient_, 100).size(), 4U);
}

TEST_F(BackupTest, AnInterruptedRestoreIsNoStore) {
  (void)BackUpStopped(state(), backup());
  (void)RestoreBackup(backup(), restored());
  fs::remove(restored() / "plumb.db");  // it comes last
  EXPECT_THROW(Store{restored()}, DatabaseCorrupt);
}

TEST_F(BackupTest, ARestoreIsInTheAuditLogOfTheFirstStart) {
  (void)BackUpStopped(state(), backup());
  const std::string sums = DigestOfFile(backup(), "SHA256SUMS").sha256;
  (void)RestoreBackup(backup(), restored());
  for (int start = 0; start < 2; ++start) {
    Store store(restored());
    const auto entries = store.audit.Find({0, 100, "backup.restore"});
    ASSERT_EQ(entries.size(), 1U) << "once, in start " << start;
    EXPECT_THAT(entries[0].detail.English(),
                AllOf(HasSubstr(backup().string() + ": 4 scans"), HasSubstr("sha256 " + sums),
                      HasSubstr("restored at 20")));
    EXPECT_EQ(store.audit.FirstBroken(), std::nullopt);
  }
  EXPECT_FALSE(fs::exists(restored() / "restored.json"));
  EXPECT_THAT(Store(state()).audit.Find({0, 100, "backup.restore"}), IsEmpty());
}

TEST_F(BackupTest, ARestoreWhoseNoteIsDamagedIsInTheAuditLogToo) {
  (void)BackUpStopped(state(), backup());
  (void)RestoreBackup(backup(), restored());
  WriteWholeFile(restored() / "restored.json", std::string_view("{"));
  Store store(restored());
  const auto entries = store.audit.Find({0, 100, "backup.restore"});
  ASSERT_EQ(entries.size(), 1U);
  EXPECT_THAT(entries[0].detail.English(), HasSubstr("cannot be read"));
}

/// As systemd mounts them for a service with PrivateTmp=yes.
TEST_F(BackupTest, AFolderOfTheServiceAloneIsNoPlaceForIt) {
  constexpr const char* kMounts =
      "22 1 254:1 / / rw - ext4 /dev/vda1 rw\n"
      "30 22 0:30 / /tmp rw - tmpfs tmpfs rw\n"
      "41 30 0:30 /systemd-private-12-plumbd.service-x/tmp /tmp rw - tmpfs tmpfs rw\n"
      "42 22 254:1 /var/tmp/systemd-private-12-plumbd.service-y/tmp /var/tmp rw - ext4 /d rw\n"
      "43 41 254:2 / /tmp/disk rw - ext4 /dev/vdb rw\n";
  const auto why = [&](const char* target, const char* mounts) {
    return WhyBackupIsLostAt(target, "/tmp", mounts).English();
  };
  for (const char* target : {"/tmp/backup", "/tmp", "/var/tmp/a/b"})
    EXPECT_THAT(why(target, kMounts),
                AllOf(HasSubstr(target), HasSubstr("visible to its service only"),
                      HasSubstr("/var/lib/plumb-backup")));
  for (const char* target : {"/tmpfolder/backup", "/var/lib/plumb-backup", "/tmp/disk/backup"})
    EXPECT_EQ(why(target, kMounts), "") << target;
  EXPECT_EQ(why("/tmp/backup", "22 1 254:1 / / rw - ext4 /dev/vda1 rw\n"), "");
  EXPECT_EQ(why("/tmp/backup", ""), "");
}

TEST_F(BackupTest, AFolderInMemoryIsNoPlaceForItUnlessTheStateIsThereToo) {
  EXPECT_THAT(WhyBackupIsLostAt("/dev/shm/no-such-folder/backup", "/", "").English(),
              HasSubstr("lies in memory"));
  EXPECT_EQ(WhyBackupIsLostAt("/dev/shm/backup", "/dev/shm", "").English(), "");
  EXPECT_EQ(WhyBackupIsLostAt("/var/lib/plumb-backup", "/", "").English(), "");
}

TEST_F(BackupTest, AnotherFolderIsNotOverwritten) {
  fs::create_directories(backup());
  WriteWholeFile(backup() / "thesis.tex", std::string_view("x"));
  EXPECT_THROW((void)BackUpStopped(state(), backup()), IoError);
  EXPECT_TRUE(fs::exists(backup() / "thesis.tex"));
  EXPECT_THROW((void)BackUpStopped(folder_ / "nothing", folder_ / "other"), IoError);
  EXPECT_FALSE(fs::exists(folder_ / "nothing" / "plumb.db"));
}

TEST_F(BackupTest, AStopLeavesNothing) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW((void)BackUpStopped(state(), backup(), stop.get_token()), Interrupted);
  EXPECT_FALSE(fs::exists(backup()));
}

}  // namespace
}  // namespace plumb
