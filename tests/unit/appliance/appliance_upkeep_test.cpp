// SPDX-License-Identifier: Apache-2.0
// Backups, checks and removals by an appliance whose ticks take a millisecond instead of a second.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <fstream>
#include <future>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/archive/backup.hpp"
#include "daemon/state_folder/outside_note.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/unit/appliance/appliance_fixture.hpp"
#include "tests/unit/records/scan_folder.hpp"
#include "words/backup.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

class ApplianceUpkeepTest : public testing::ApplianceTest {
 protected:
  ApplianceUpkeepTest() {
    parts_.demo_patient.clear();
    parts_.tick = milliseconds(1);
    parts_.storage.space = [this, space = parts_.storage.space](const fs::path& folder,
                                                                std::error_code& error) {
      if (folder == state()) ++num_ticks_;
      return space(folder, error);
    };
  }

  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  /// On the loop's thread.
  [[nodiscard]] bool Warns(const std::string& begin) const {
    const std::vector<std::string> warnings =
        EnglishTexts(appliance_->WebStatus().storage.warnings);
    return std::any_of(warnings.begin(), warnings.end(),
                       [&](const std::string& warning) { return warning.starts_with(begin); });
  }
  [[nodiscard]] std::vector<AuditEntry> Backups() const {
    return shared_->store->audit.Find({0, 100, "backup.make"});
  }
  /// Like Becomes(), but leaves the processor to a backup, which gives way to everything else.
  [[nodiscard]] bool Comes(const std::function<bool()>& holds) {
    return Becomes(holds, std::chrono::seconds(60), milliseconds(10));
  }
  /// The disk is examined once in each tick.
  void WaitForTicks(int count) {
    const int end = num_ticks_ + count;
    EXPECT_TRUE(Comes([&] { return num_ticks_ >= end; }));
  }
  /// Until the store's thread has done everything that was posted to it.
  void WaitForStore() {
    const auto done = std::make_shared<std::promise<void>>();
    On([&] { EXPECT_TRUE(shared_->store_thread.Post([done] { done->set_value(); })); });
    done->get_future().wait();
  }
  /// A patient's reference and two more scans; their numbers.
  std::vector<std::string> StoreScans(int retention_days = 0) const {
    Store store(state());
    const std::string patient = store.patients.Add(testing::kAnna, "P", "");
    std::vector<std::string> scans;
    for (int i = 0; i < 3; ++i) scans.push_back(testing::StoreScan(store, patient));
    (void)testing::PlanAndApprove(store, store.references.Add(testing::kAnna, scans[0], "", {}));
    Settings settings = store.settings.Get();
    settings.retention_days = retention_days;
    store.settings.Change(testing::kAnna, settings);
    return scans;
  }
  /// Numbers of the stored scans, the oldest first. On the loop's thread.
  [[nodiscard]] std::vector<std::string> Stored() const {
    std::vector<std::string> ids;
    for (const Scan& scan : shared_->store->scans.List("", 100)) ids.push_back(scan.id);
    std::sort(ids.begin(), ids.end());
    return ids;
  }
  static constexpr const char* kVerificationDue =
      "No verification of an encrypted backup has been noted for half a year";
  /// The first one was made 184 days ago.
  void LetABackupBeOld(bool is_encrypted) const {
    constexpr std::int64_t kDays_us = 184LL * 24 * 3600 * 1'000'000;
    const Message made = say::backup::LogMade("/backups/one", 3, 20, 1000, 0);
    Store(state()).audit.Log(kTester, "backup.make", "",
                             is_encrypted ? say::backup::LogEncrypted(made) : made);
    ChangeDatabase("DROP TRIGGER audit_no_update; UPDATE audit SET time = time - " +
                   std::to_string(kDays_us));
  }
  /// No verification is asked for while one more backup is made and for some time after.
  void ExpectNoReminderAfterABackup() {
    Play([&] {
      ASSERT_TRUE(Comes([&] { return Backups().size() == 2; }));
      WaitForTicks(400);
      On([&] { EXPECT_FALSE(Warns(kVerificationDue)); });
    });
  }
  void EncryptBackups() {
    parts_.config.appliance.backup_recipients =
        AgeRecipients({"age1z8q8p3f3getd6h87azd0zc2vzskwttwywjqumzv8yqddd73pwg3svc56n6"});
  }
  void ChangeDatabase(const std::string& sql) const {
    Database(state() / "plumb.db", Database::Access::kReadWrite).Execute(sql);
  }

 private:
  std::atomic<int> num_ticks_ = 0;
};

TEST_F(ApplianceUpkeepTest, ABackupIsMadeWhenItIsDueAndNotBefore) {
  parts_.config.appliance.backup_folder = folder_ / "backups";
  (void)StoreScans();
  Play([&] {
    ASSERT_TRUE(Comes([&] { return Backups().size() == 1; }));
    WaitForTicks(400);  // several intervals
    On([&] {
      ASSERT_EQ(Backups().size(), 1U) << "it is not due again";
      EXPECT_EQ(Backups()[0].user, "plumbd");
      EXPECT_THAT(Backups()[0].detail.English(), ::testing::HasSubstr("3 scans"));
    });
    const auto make_older = [&](std::chrono::hours age) {
      for (const auto& entry : fs::recursive_directory_iterator(folder_ / "backups")) {
        if (entry.path().filename() == "backup.json")
          fs::last_write_time(entry.path(), fs::file_time_type::clock::now() - age);
      }
    };
    make_older(std::chrono::hours(23));
    WaitForTicks(400);
    On([&] { EXPECT_EQ(Backups().size(), 1U) << "one a day"; });
    make_older(std::chrono::hours(25));
    EXPECT_TRUE(Comes([&] { return Backups().size() == 2; }));
    make_older(std::chrono::hours(-25));
    EXPECT_TRUE(Comes([&] { return Backups().size() == 3; })) << "a time in the future is wrong";
    On([&] { EXPECT_FALSE(Warns("No backup is set up")); });
  });
}

TEST_F(ApplianceUpkeepTest, AFailedBackupIsAWarningAndIsTriedAgain) {
  parts_.config.appliance.backup_folder = folder_ / "disk" / "backups";
  std::ofstream(folder_ / "disk") << "a file where the disk should be";
  Play([&] {
    ASSERT_TRUE(Comes([&] { return Warns("The last backup failed: "); }));
    fs::remove(folder_ / "disk");
    fs::create_directory(folder_ / "disk");
    ASSERT_TRUE(Comes([&] { return Backups().size() == 1; }));
    EXPECT_TRUE(Comes([&] { return !Warns("The last backup failed: "); }));
    On([&] { EXPECT_EQ(Backups()[0].user, "plumbd"); });
  });
}

TEST_F(ApplianceUpkeepTest, ABackupFromThePageEndsTheWarningOfAFailedOne) {
  parts_.tick = milliseconds(5);  // the schedule tries again only after 18 s
  parts_.config.appliance.backup_folder = folder_ / "disk" / "backups";
  std::ofstream(folder_ / "disk") << "a file where the disk should be";
  Play([&] {
    ASSERT_TRUE(Comes([&] { return Warns("The last backup failed: "); }));
    const auto press = [&] {
      const auto made = std::make_shared<std::promise<Change>>();
      On([&] {
        services_->services().maintenance.MakeBackup(
            kTester, [made](const Change& change) { made->set_value(change); });
      });
      return made->get_future().get();
    };
    EXPECT_EQ(press().result, ChangeResult::kFailed);
    fs::remove(folder_ / "disk");
    fs::create_directory(folder_ / "disk");
    EXPECT_EQ(press().result, ChangeResult::kDone);
    On([&] {
      ASSERT_EQ(Backups().size(), 1U);
      EXPECT_EQ(Backups()[0].user, kTester.user);
      EXPECT_FALSE(Warns("The last backup failed: "));
    });
  });
}

TEST_F(ApplianceUpkeepTest, APlainBackupIsOpenedByPlumbdItselfAndAsksNobody) {
  parts_.config.appliance.backup_folder = folder_ / "backups";
  LetABackupBeOld(true);
  ExpectNoReminderAfterABackup();
}

TEST_F(ApplianceUpkeepTest, TheDayOnWhichBackupsAreFirstEncryptedIsNotHalfAYearTooLate) {
  parts_.config.appliance.backup_folder = folder_ / "backups";
  EncryptBackups();
  LetABackupBeOld(false);
  ExpectNoReminderAfterABackup();
}

TEST_F(ApplianceUpkeepTest, ThatAnEncryptedBackupIsToBeVerifiedIsAWarningUntilItIsNoted) {
  parts_.config.appliance.backup_folder = folder_ / "backups";
  EncryptBackups();
  LetABackupBeOld(true);
  Play([&] {
    EXPECT_TRUE(Comes([&] { return Warns(kVerificationDue); }));
    const auto noted = std::make_shared<std::promise<Change>>();
    On([&] {
      services_->services().maintenance.NoteBackupVerified(
          kTester, [noted](const Change& change) { noted->set_value(change); });
    });
    EXPECT_EQ(noted->get_future().get().result, ChangeResult::kDone);
    EXPECT_TRUE(Comes([&] { return !Warns(kVerificationDue); }));
    On([&] {
      const auto entries = shared_->store->audit.Find({0, 10, "backup.verify"});
      ASSERT_EQ(entries.size(), 1U);
      EXPECT_EQ(entries[0].user, kTester.user);
    });
  });
}

TEST_F(ApplianceUpkeepTest, ThatNoBackupIsSetUpIsAWarning) {
  Play([&] {
    On([&] {
      EXPECT_TRUE(Warns("No backup is set up"));
      parts_.config.appliance.backup_folder = folder_ / "backups";
      appliance_->Reload(parts_.config);
      EXPECT_FALSE(Warns("No backup is set up"));
    });
  });
}

TEST_F(ApplianceUpkeepTest, TheDemoNeedsNoBackup) {
  parts_.demo_patient = "demo";
  Play([&] { On([&] { EXPECT_FALSE(Warns("No backup is set up")); }); });
}

TEST_F(ApplianceUpkeepTest, AFileThatChangesWhileTheApplianceRunsIsAWarning) {
  const std::string scan = StoreScans().back();
  const std::string warning = "Files of some stored scans (1) are missing or changed";
  Play([&] {
    const auto are_checked = [&] {
      Database database(state() / "plumb.db", Database::Access::kReadOnly);
      Statement query = database.Prepare("SELECT 1 FROM scans WHERE checked_at <= 1");
      return !query.Step();
    };
    ASSERT_TRUE(Comes(are_checked));
    On([&] { EXPECT_FALSE(Warns(warning)); });
    std::fstream file(state() / "scans" / scan / "scene" / "cloud.ply",
                      std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(3);
    file.put('X');
    file.close();
    ChangeDatabase("UPDATE scans SET checked_at = 1");  // as if a day had passed
    EXPECT_TRUE(Comes([&] { return Warns(warning); }));
    On([&] {
      const auto entries = shared_->store->audit.Find({0, 10, "scan.unavailable"});
      ASSERT_EQ(entries.size(), 1U);
      EXPECT_EQ(entries[0].subject, scan);
    });
  });
}

TEST_F(ApplianceUpkeepTest, ARecordingHasADigestSoonAfterItsScan) {
  parts_.tick = milliseconds(50);  // the next search would come after half a minute
  Play([&] {
    MakeReady();
    WaitForTicks(50);  // the first search has found nothing
    std::string scan;
    On([&] {
      Store& store = *shared_->store.get();
      scan = testing::StoreScan(store, "", [](const fs::path& folder) {
        testing::FillScan(folder);
        fs::create_directory(folder / "recording");
        WriteWholeFile(folder / "recording" / "rgb.txt", std::string_view("images"));
      });
      EXPECT_EQ(appliance_->StartSweep(kTester).English(), "");
      EXPECT_EQ(appliance_->Cancel(kTester).English(), "");
    });
    const auto has_digest = [&] {
      Database database(state() / "plumb.db", Database::Access::kReadOnly);
      return database.Prepare("SELECT 1 FROM scan_files WHERE path = 'recording'").Step();
    };
    EXPECT_TRUE(Becomes(has_digest, std::chrono::seconds(10), milliseconds(100)));
  });
}

TEST_F(ApplianceUpkeepTest, WhatIsInTheLogOfWritesAloneGoesIntoTheDatabaseSoon) {
  (void)StoreScans();
  const fs::path log = state() / "plumb.db-wal";
  Play([&] {
    MakeReady();
    On([&] { shared_->store->audit.Log(kTester, "login", "", Message()); });
    EXPECT_TRUE(Comes([&] { return fs::file_size(log) == 0; }));
  });
}

constexpr const char* kRolledBack = "The data of this unit is older than the note";

TEST_F(ApplianceUpkeepTest, TheEndOfTheLogIsNotedBesideTheBackups) {
  const fs::path backups = folder_ / "backups";
  parts_.config.appliance.backup_folder = backups;
  fs::create_directories(backups);
  const std::size_t num_scans = StoreScans().size();
  Play([&] {
    EXPECT_TRUE(Comes([&] { return ReadOutsideNote(backups).has_value(); }));
    On([&] { EXPECT_FALSE(Warns(kRolledBack)); });
  });
  EXPECT_EQ(ReadOutsideNote(backups)->last_scan, static_cast<std::int64_t>(num_scans));
  EXPECT_FALSE(ReadOutsideNote(backups)->heads.empty());
}

TEST_F(ApplianceUpkeepTest, AStateFolderThatWasRolledBackIsAWarning) {
  const fs::path backups = folder_ / "backups";
  parts_.config.appliance.backup_folder = backups;
  fs::create_directories(backups);
  (void)StoreScans();
  WriteOutsideNote(backups,
                   {.last_scan = 41, .heads = {{.number = 100, .chain = "of another log"}}});
  Play([&] {
    EXPECT_TRUE(Comes([&] { return Warns(kRolledBack); }));
    On([&] { EXPECT_EQ(testing::StoreScan(*shared_->store.get(), ""), "000042"); });
  });
  EXPECT_EQ(ReadOutsideNote(backups)->last_scan, 41) << "it stays as it was";
}

TEST_F(ApplianceUpkeepTest, FoldersThatWereSetAsideAreAWarning) {
  (void)StoreScans();
  fs::copy(state() / "scans" / "000003", state() / "scans" / "000007", fs::copy_options::recursive);
  Play([&] {
    EXPECT_TRUE(Comes([&] {
      return Warns("Some scan folders (1) have no entry in the database and were moved to");
    }));
  });
}

TEST_F(ApplianceUpkeepTest, AboveTheConfiguredQuotaScansAreRemovedButNotReferences) {
  parts_.config.appliance.quota_gb = 1e-9;
  parts_.removal_rules = testing::kAtOnce;
  const std::vector<std::string> scans = StoreScans();
  std::ofstream(state() / "remove-without-backup") << "";
  Play([&] {
    EXPECT_TRUE(Comes([&] { return Stored() == std::vector{scans[0]}; }));
    On([&] {
      const auto entries = shared_->store->audit.Find({0, 10, "scan.remove"});
      ASSERT_EQ(entries.size(), 2U);
      EXPECT_EQ(entries[0].detail.English(), "quota");
      (void)testing::StoreScan(*shared_->store.get(), "1");
    });
    EXPECT_TRUE(Comes([&] { return Stored() == std::vector{scans[0]}; })) << "and again later";
  });
}

TEST_F(ApplianceUpkeepTest, WithoutABackupNothingIsRemovedAndThatIsSaid) {
  parts_.config.appliance.quota_gb = 1e-9;
  parts_.removal_rules = testing::kAtOnce;
  const std::vector<std::string> scans = StoreScans();
  Play([&] {
    EXPECT_TRUE(Comes([&] { return Warns("Scans are due to be removed"); }));
    WaitForTicks(4000);
    WaitForStore();
    On([&] { EXPECT_EQ(Stored(), scans); });
  });
}

TEST_F(ApplianceUpkeepTest, ARemovalIsAnnounced) {
  parts_.config.appliance.quota_gb = 1e-9;
  const std::vector<std::string> scans = StoreScans();
  std::ofstream(state() / "remove-without-backup") << "";
  Play([&] {
    EXPECT_TRUE(Comes([&] { return Warns("In a day, scans will be removed"); }));
    On([&] { EXPECT_EQ(Stored(), scans); });
  });
}

TEST_F(ApplianceUpkeepTest, WhatAVerifiedBackupHoldsIsRemoved) {
  const fs::path backups = folder_ / "backups";
  parts_.config.appliance.backup_folder = backups;
  parts_.config.appliance.quota_gb = 1e-9;
  parts_.removal_rules.notice = std::chrono::seconds(0);
  const std::vector<std::string> scans = StoreScans();
  Play([&] { EXPECT_TRUE(Comes([&] { return Stored() == std::vector{scans[0]}; })); });
}

TEST_F(ApplianceUpkeepTest, ABackupThatChangesIsAWarning) {
  const fs::path backups = folder_ / "backups";
  parts_.config.appliance.backup_folder = backups;
  (void)StoreScans();
  const auto checked = [&](const std::string& what) {
    return Database(state() / "plumb.db", Database::Access::kReadOnly)
        .Has("SELECT 1 FROM backups WHERE " + what);
  };
  Play([&] {
    ASSERT_TRUE(Comes([&] { return checked("verified_at > 0"); }));
    On([&] { EXPECT_FALSE(Warns("A backup cannot be relied on")); });
    for (const auto& entry : fs::recursive_directory_iterator(backups)) {
      if (entry.path().filename() != "cloud.ply") continue;
      fs::permissions(entry.path(), fs::perms::owner_write, fs::perm_options::add);
      std::ofstream(entry.path(), std::ios::app) << "x";
      break;
    }
    On([&] { shared_->store->database().ForChanges()->Run("UPDATE backups SET checked_at = 0"); });
    EXPECT_TRUE(Comes([&] { return Warns("A backup cannot be relied on"); }));
    EXPECT_FALSE(checked("verified_at > 0"));
  });
}

TEST_F(ApplianceUpkeepTest, WhatARestoreReplacedIsAWarning) {
  (void)StoreScans();
  (void)BackUpStopped(state(), folder_ / "backup");
  (void)RestoreOver(folder_ / "backup", state());
  Play([&] {
    EXPECT_TRUE(Comes([&] { return Warns("Data from before a restore"); }));
    fs::remove_all(state() / "before-restore-1");
    EXPECT_TRUE(Comes([&] { return !Warns("Data from before a restore"); }));
  });
}

TEST_F(ApplianceUpkeepTest, AChangedConfigurationIsInTheLogWithItsKeys) {
  const auto with = [&](const std::string& text) {
    Config config = ParseConfig(text, "plumb.toml", ConfigUse::kAppliance);
    config.appliance.state = state();
    return config;
  };
  parts_.config = with("[appliance]\nwarm_up_min = 15\n[web]\nlisten = \"127.0.0.1:1\"\n");
  const auto entries = [&] { return shared_->store->audit.Find({0, 10, "config.reload"}); };
  Play([&] {
    const Config next = with("[appliance]\nwarm_up_min = 20\nquota_gb = 5.0\n");
    On([&] { appliance_->Reload(next); });
    ASSERT_TRUE(Comes([&] { return entries().size() == 1; }));
    On([&] {
      EXPECT_EQ(entries()[0].user, "plumbd");
      EXPECT_EQ(entries()[0].detail.English(),
                R"({"appliance.quota_gb":[null,"5.0"],"appliance.warm_up_min":["15","20"],)"
                R"("web.listen":["'127.0.0.1:1'",null,"restart"]})");
      appliance_->Reload(next);
    });
    WaitForStore();
    On([&] { EXPECT_EQ(entries().size(), 1U) << "nothing was changed"; });
  });
}

class ApplianceRetentionTest : public ApplianceUpkeepTest {
 protected:
  ApplianceRetentionTest() {
    scans_ = StoreScans(/*retention_days=*/30);
    constexpr std::int64_t kTwoMonths_us = 60LL * 24 * 3600 * 1'000'000;
    ChangeDatabase("UPDATE scans SET started_at = started_at - " + std::to_string(kTwoMonths_us));
    std::ofstream(state() / "remove-without-backup") << "";
    parts_.removal_rules = testing::kAtOnce;
    parts_.storage.is_clock_kept = [] { return false; };
  }
  /// As if the unit had been off for a month; or the clock is wrong.
  void LetClockLeap() const {
    constexpr std::int64_t kMonth_us = 30LL * 24 * 3600 * 1'000'000;
    ChangeDatabase("DROP TRIGGER audit_no_update; UPDATE audit SET time = time - " +
                   std::to_string(kMonth_us));
  }
  std::vector<std::string> scans_;
};

TEST_F(ApplianceRetentionTest, OldScansAreRemovedByATrustedClock) {
  parts_.clock_trusted_after = milliseconds(200);
  Play([&] {
    EXPECT_TRUE(Comes([&] { return Stored() == std::vector{scans_[0]}; }));
    On([&] {
      EXPECT_EQ(shared_->store->audit.Find({0, 10, "scan.remove"})[0].detail.English(),
                "retention");
    });
  });
}

TEST_F(ApplianceRetentionTest, AClockThatLeaptRemovesNothing) {
  parts_.clock_trusted_after = milliseconds(200);
  LetClockLeap();
  Play([&] {
    EXPECT_TRUE(Comes([&] { return Warns("The clock was far ahead"); }));
    WaitForTicks(4000);
    WaitForStore();
    On([&] { EXPECT_EQ(Stored(), scans_); });
  });
}

TEST_F(ApplianceRetentionTest, AClockThatLeaptIsTrustedOnceATimeServerKeepsIt) {
  parts_.clock_trusted_after = milliseconds(200);
  parts_.storage.is_clock_kept = [] { return true; };
  LetClockLeap();
  Play([&] { EXPECT_TRUE(Comes([&] { return Stored() == std::vector{scans_[0]}; })); });
}

TEST_F(ApplianceRetentionTest, AClockThatIsNotYetTrustedRemovesNothing) {
  Play([&] {
    WaitForStore();  // the removal at the start
    On([&] { EXPECT_EQ(Stored(), scans_); });
    WaitForTicks(4000);  // and the next one
    WaitForStore();
    On([&] { EXPECT_EQ(Stored(), scans_); });
  });
}

}  // namespace
}  // namespace plumb
