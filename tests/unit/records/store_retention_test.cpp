// SPDX-License-Identifier: Apache-2.0
// Which scans are removed with time, and what is left of a scan that could not be stored.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/archive/backup_register.hpp"
#include "daemon/archive/factory_reset.hpp"
#include "daemon/archive/store_backup.hpp"
#include "daemon/database/clock_doubt.hpp"
#include "daemon/database/examination.hpp"
#include "daemon/database/schema.hpp"
#include "tests/support/full_disk.hpp"
#include "tests/unit/records/store_fixture.hpp"
#include "words/backup.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using testing::kAnna;
using testing::kAtOnce;
using testing::kResult;
using testing::StoreTest;

TEST_F(StoreTest, OldScansGoAndReferencesStay) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "A", "");
  const std::string reference = ApprovedReference(*store, patient);
  const std::string old = Scan(*store, patient, reference, kResult);
  {
    Database direct(database(), Database::Access::kReadWrite);
    direct.Execute("UPDATE scans SET started_at = 0");
  }
  const std::string fresh = Scan(*store, patient, reference, kResult);
  EXPECT_EQ(store->removal.RemoveOldScans(0, kAtOnce).removed, 0) << "0: never";
  EXPECT_EQ(store->removal.RemoveOldScans(30, kAtOnce).removed, 1);
  EXPECT_EQ(store->scans.Find(old), std::nullopt);
  EXPECT_FALSE(fs::exists(store->folders.Scan(old)));
  EXPECT_TRUE(fs::exists(store->folders.Bin(old) / "scene"));
  EXPECT_TRUE(store->scans.Find(fresh));
  EXPECT_TRUE(fs::exists(store->folders.Scan(store->references.Find(reference)->scan_id)));
}

TEST_F(StoreTest, AWrongClockMakesNoScanOld) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "A", "");
  const std::string first = Scan(*store, patient), with_early_clock = Scan(*store, patient),
                    with_late_clock = Scan(*store, patient);
  const std::string last = Scan(*store, patient);
  const auto stamp = [&](const std::string& scan, const std::string& time) {
    Database(database(), Database::Access::kReadWrite)
        .Execute("UPDATE scans SET started_at = " + time + " WHERE id = " + scan);
  };
  stamp(with_early_clock, "0");
  stamp(with_late_clock, "9000000000000000");
  EXPECT_EQ(store->removal.RemoveOldScans(30, kAtOnce).removed, 0);
  for (const std::string& scan : {first, last}) stamp(scan, "1000000");
  EXPECT_EQ(store->removal.RemoveOldScans(30, kAtOnce).removed, 4)
      << "a stamp of the future keeps nothing for ever";
}

TEST_F(StoreTest, CareEndsSoonWhenItIsTold) {
  const auto store = Open();
  (void)Scan(*store, store->patients.Add(kAnna, "A", ""));
  Database(database(), Database::Access::kReadWrite).Execute("UPDATE scans SET started_at = 0");
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(store->removal.RemoveOldScans(30, kAtOnce, stop.get_token()).removed, 0);
  EXPECT_EQ(store->removal.KeepWithinQuota(0, kAtOnce, stop.get_token()).removed, 0);
  EXPECT_EQ(store->removal.KeepWithinQuota(0, kAtOnce).removed, 1);
}

TEST_F(StoreTest, AScanWhoseRowTheDiskRefusesIsNoneAndLeavesNothing) {
  std::string patient, id;
  {
    const auto store = Open();
    patient = store->patients.Add(kAnna, "A", "");
  }
  EXPECT_EQ(
      testing::WriteOnFullDisk(
          200'000,
          [&] {
            const auto store = Open();
            const std::string scan = store->scans.Begin(
                {.patient_id = patient, .reference_id = {}, .purpose = {}, .sensor_serial = {}});
            FillStaging(*store, scan);
            const std::string large(400'000, ' ');  // does not fit
            EXPECT_THROW(store->scans.Finish(scan, {.outcome = ScanOutcome::kDone,
                                                    .result_json = "{}" + large,
                                                    .swept_area_m2 = 0}),
                         IoError);
            EXPECT_FALSE(fs::exists(store->folders.Scan(scan)));
            EXPECT_TRUE(fs::exists(store->folders.Staging(scan)));
            if (::testing::Test::HasFailure()) throw std::logic_error("see above");
            store->removal.WipePatient(kAnna, patient);  // it does not run any more
          }),
      testing::WriteOutcome::kDone);
  EXPECT_EQ(Open()->patients.List().size(), 0U);
  EXPECT_TRUE(fs::is_empty(folder_ / "state" / "scans"));
}

TEST_F(StoreTest, AScanThatCouldNotBeEndedHasFailedWhenTheNextBegins) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "A", "");
  const NewScan scan{.patient_id = patient, .reference_id = {}, .purpose = {}, .sensor_serial = {}};
  const std::string lost = store->scans.Begin(scan);
  (void)store->scans.Begin(scan);
  EXPECT_EQ(store->scans.Find(lost)->outcome, ScanOutcome::kFailed);
}

TEST_F(StoreTest, TheQuotaTakesRecordingsFirstThenOldScansAndNeverReferences) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "A", "");
  const std::string reference = ApprovedReference(*store, patient);
  const std::string reference_scan = store->references.Find(reference)->scan_id;
  const std::string old = Scan(*store, patient, reference, kResult),
                    fresh = Scan(*store, patient, reference, kResult);
  for (const std::string& scan : {reference_scan, old, fresh}) {
    fs::create_directory(store->folders.Scan(scan) / "recording");
    WriteWholeFile(store->folders.Scan(scan) / "recording" / "rgb.txt", std::string(1000, 'r'));
    WriteWholeFile(store->folders.Scan(scan) / "scene" / "cloud.ply", std::string(1000, 'c'));
  }
  EXPECT_EQ(store->removal.KeepWithinQuota(7000, kAtOnce).removed, 0);
  EXPECT_GT(store->removal.KeepWithinQuota(5100, kAtOnce).removed, 0);
  EXPECT_FALSE(fs::exists(store->folders.Scan(reference_scan) / "recording"));
  EXPECT_TRUE(store->scans.Find(old));
  (void)store->removal.KeepWithinQuota(2100, kAtOnce).removed;
  EXPECT_EQ(store->scans.Find(old), std::nullopt);
  EXPECT_TRUE(store->scans.Find(fresh));
  (void)store->removal.KeepWithinQuota(0, kAtOnce).removed;
  EXPECT_TRUE(fs::exists(store->folders.Scan(reference_scan) / "scene"));
}

TEST_F(StoreTest, ScansWhoseFilesAreOutOfSightAreNeitherOldNorOverTheQuota) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "A", "");
  const std::string out_of_sight = Scan(*store, patient), in_sight = Scan(*store, patient);
  const std::string changed = Scan(*store, patient);
  fs::create_directory(store->folders.Scan(out_of_sight) / "recording");
  const fs::path elsewhere = folder_ / "elsewhere";
  fs::rename(store->folders.Scan(out_of_sight), elsewhere);
  Database(database(), Database::Access::kReadWrite)
      .Execute(
          "UPDATE scans SET started_at = 0; UPDATE scans SET unavailable = 'it is missing' "
          "WHERE id IN (" +
          out_of_sight + ", " + changed + ")");
  EXPECT_EQ(store->removal.RemoveOldScans(30, kAtOnce).removed, 2)
      << "a changed one is as old as any other";
  EXPECT_TRUE(store->scans.Find(out_of_sight));
  EXPECT_EQ(store->scans.Find(in_sight), std::nullopt);
  EXPECT_EQ(store->scans.Find(changed), std::nullopt);
  (void)Scan(*store, patient);
  EXPECT_EQ(store->removal.KeepWithinQuota(0, kAtOnce).removed, 1) << "the one that is in sight";
  EXPECT_TRUE(store->scans.Find(out_of_sight));
  fs::rename(elsewhere, store->folders.Scan(out_of_sight));
  Database(database(), Database::Access::kReadWrite).Execute("UPDATE scans SET unavailable = ''");
  EXPECT_EQ(store->removal.KeepWithinQuota(0, kAtOnce).removed, 2) << "its recording and itself";
}

TEST_F(StoreTest, TheLogSaysWhetherAgeOrTheQuotaRemovedAScan) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "A", "");
  const auto reason = [&] {
    return store->audit.Find({0, 1, "scan.remove"}).at(0).detail.English();
  };
  (void)Scan(*store, patient);
  EXPECT_EQ(store->removal.KeepWithinQuota(0, kAtOnce).removed, 1);
  EXPECT_EQ(reason(), "quota");
  (void)Scan(*store, patient);
  Database(database(), Database::Access::kReadWrite).Execute("UPDATE scans SET started_at = 0");
  EXPECT_EQ(store->removal.RemoveOldScans(30, kAtOnce).removed, 1);
  EXPECT_EQ(reason(), "retention");
}

TEST_F(StoreTest, WithoutAQuotaScansTakeNineTenthsOfTheDiskWhateverElseIsOnIt) {
  EXPECT_EQ(DefaultQuota(10'000), 9'000U);
  EXPECT_EQ(DefaultQuota(0), 0U);
}

class RetentionTest : public StoreTest {
 protected:
  static constexpr RemovalRules kWithBackup{
      .needs_backup = true, .notice = std::chrono::seconds(0), .most_a_day = 1000};
  static constexpr RemovalRules kWithNotice{.needs_backup = false};

  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  void Change(const std::string& sql) const {
    Database(database(), Database::Access::kReadWrite).Execute(sql);
  }
  /// Scans of long ago; the store is closed.
  std::vector<std::string> OldScans(int count) const {
    std::vector<std::string> scans;
    {
      const auto store = Open();
      const std::string patient = store->patients.Add(kAnna, "A", "");
      for (int i = 0; i < count; ++i) scans.push_back(Scan(*store, patient));
    }
    Change("UPDATE scans SET started_at = 0");
    return scans;
  }
  static std::string Us(int hours) { return std::to_string(hours * 3'600'000'000LL); }
};

TEST_F(RetentionTest, ThatABackupIsVerifiedIsAskedForTwiceAYear) {
  using std::chrono::hours;
  using std::chrono::seconds;
  const auto store = Open();
  const auto is_due = [&](WallClock::time_point now) {
    return IsVerificationDue(*store->database().ForLists(), now);
  };
  const auto time_of = [&](const char* action) {
    return store->audit.Find({0, 1, action})[0].time;
  };
  EXPECT_FALSE(is_due(WallClock::now() + 10 * kVerifiedEvery)) << "there is no backup";
  const Message made = say::backup::LogMade("/backups/one", 3, 20, 1000, 0);
  store->audit.Log(kAnna, "backup.make", "", made);
  EXPECT_FALSE(is_due(WallClock::now() + 10 * kVerifiedEvery)) << "it is not encrypted";
  store->audit.Log(kAnna, "backup.make", "", say::backup::LogEncrypted(made));
  const WallClock::time_point first = time_of("backup.make");
  EXPECT_FALSE(is_due(first + hours(24 * 183)));
  EXPECT_TRUE(is_due(first + hours(24 * 183) + seconds(1)));
  store->audit.Log(kAnna, "backup.verify", "", Message());
  const WallClock::time_point verified = time_of("backup.verify");
  EXPECT_FALSE(is_due(verified + hours(24 * 183)));
  EXPECT_TRUE(is_due(verified + hours(24 * 183) + seconds(1)));
  store->audit.Log(kAnna, "backup.make", "", Message());
  EXPECT_TRUE(is_due(verified + hours(24 * 183) + seconds(1))) << "a new one proves nothing";
}

TEST_F(RetentionTest, WhatNoVerifiedBackupHoldsStays) {
  const std::vector<std::string> scans = OldScans(2);
  const auto store = Open();
  const auto removed = [&] {
    const Removals done = store->removal.RemoveOldScans(30, kWithBackup);
    EXPECT_EQ(done.uncopied, static_cast<int>(store->scans.List("1", 9).size())) << "what stays";
    return done.removed;
  };
  EXPECT_EQ(removed(), 0);
  EXPECT_EQ(store->removal.KeepWithinQuota(0, kWithBackup).uncopied, 2);
  // One of them is not as it was stored, and so neither in the backup.
  WriteWholeFile(store->folders.Scan(scans[1]) / "scene" / "scene.json", std::string_view("[]"));
  const fs::path backup = folder_ / "backup.tar";
  (void)StoreBackup(*store).Make(kAnna, backup);
  EXPECT_EQ(removed(), 0) << "not verified yet";
  EXPECT_EQ(CheckNextBackup(store->database(), std::chrono::hours(24))->fault.English(), "");
  EXPECT_EQ(CheckNextBackup(store->database(), std::chrono::hours(24)), std::nullopt)
      << "once a day";
  {
    const StoreDatabase::Held writer = store->database().ForChanges();
    writer->Run("UPDATE backups SET verified_at = verified_at - " + Us(49));
  }
  EXPECT_EQ(removed(), 0) << "verified too long ago";
  {
    const StoreDatabase::Held writer = store->database().ForChanges();
    writer->Run("UPDATE backups SET verified_at = checked_at, checked_at = 0");
  }
  std::string bytes = ReadTextFile(backup, 1U << 26U);
  bytes[bytes.size() / 2] ^= 1;
  WriteWholeFile(backup, bytes);
  EXPECT_THAT(CheckNextBackup(store->database(), std::chrono::hours(24))->fault.English(),
              ::testing::HasSubstr("its bytes have changed"));
  EXPECT_EQ(removed(), 0) << "not as it was made";
  (void)StoreBackup(*store).Make(kAnna, backup);
  EXPECT_EQ(CheckNextBackup(store->database(), std::chrono::hours(24))->fault.English(), "");
  EXPECT_EQ(removed(), 1);
  EXPECT_TRUE(store->scans.Find(scans[1])) << "no backup holds it";
}

TEST_F(RetentionTest, ARemovalIsAnnouncedADayBefore) {
  const std::vector<std::string> scans = OldScans(2);
  const auto store = Open();
  const auto shift = [&](const std::string& by) {
    store->database().ForChanges()->Run("UPDATE removals SET announced_at = announced_at " + by);
  };
  const auto remove = [&] { return store->removal.RemoveOldScans(30, kWithNotice); };
  EXPECT_EQ(remove().announced, 2);
  shift("- " + Us(23));
  EXPECT_EQ(remove().removed, 0);
  shift("+ " + Us(48));
  EXPECT_EQ(remove().announced, 2) << "a clock that was set back begins anew";
  shift("- " + Us(25));
  (void)testing::PlanAndApprove(*store, store->references.Add(kAnna, scans[0], "", {}));
  const Removals done = remove();
  EXPECT_EQ(done.removed, 1);
  EXPECT_EQ(done.announced, 0);
  EXPECT_TRUE(store->scans.Find(scans[0])) << "it has become a reference";
  EXPECT_FALSE(store->database().ForRows()->Has("SELECT 1 FROM removals"));
}

TEST_F(RetentionTest, FewAreRemovedADay) {
  (void)OldScans(8);
  const auto store = Open();
  RemovalRules rules = testing::kAtOnce;
  rules.most_a_day = 5;
  EXPECT_EQ(store->removal.RemoveOldScans(30, rules).removed, 5);
  const Removals again = store->removal.RemoveOldScans(30, rules);
  EXPECT_EQ(again.removed, 0);
  EXPECT_EQ(again.announced, 3);
  EXPECT_EQ(store->removal.KeepWithinQuota(0, rules).removed, 0) << "for whatever reason";
  for (int i = 0; i < 28; ++i) (void)Scan(*store, "1");  // four a day
  EXPECT_EQ(store->removal.RemoveOldScans(30, rules).removed, 3);
}

TEST_F(RetentionTest, AcceptedResultsOutliveOthers) {
  const std::vector<std::string> scans = OldScans(3);
  Change("UPDATE scans SET accepted_by = 'anna' WHERE id = " + scans[0]);
  const auto store = Open();
  RemovalRules rules = testing::kAtOnce;
  rules.most_a_day = 2;
  EXPECT_EQ(store->removal.KeepWithinQuota(0, rules).removed, 2);
  EXPECT_TRUE(store->scans.Find(scans[0]));
}

TEST_F(RetentionTest, TheBinKeepsForAMonthWhatSomebodyRemoved) {
  const std::vector<std::string> scans = OldScans(3);
  const auto exists = [](Store& store, const std::string& scan) {
    return fs::exists(store.folders.Bin(scan) / "scene" / "scene.json");
  };
  {
    const auto store = Open();
    for (const std::string& scan : scans) store->removal.RemoveScan(kAnna, scan, "a mistake");
    EXPECT_TRUE(exists(*store, scans[0]));
    EXPECT_TRUE(store->folders.All().empty());
    (void)store->removal.RemoveOldScans(0, kWithBackup);
    EXPECT_TRUE(exists(*store, scans[0]));
  }
  Change("UPDATE bin SET binned_at = binned_at - " + Us(30 * 24) + " WHERE scan_id = " + scans[0]);
  {
    // As if the power had gone between the row and the files.
    const ScanFolders folders(state());
    fs::rename(folders.Bin(scans[1]), folders.Scan(scans[1]));
    const auto store = Open();
    EXPECT_TRUE(exists(*store, scans[1]));
    (void)store->removal.RemoveOldScans(0, kWithBackup);
    EXPECT_FALSE(exists(*store, scans[0]));
    EXPECT_TRUE(exists(*store, scans[2]));
    (void)store->removal.KeepWithinQuota(0, kWithBackup);
    EXPECT_FALSE(exists(*store, scans[2])) << "it goes first for want of room";
    const std::string scan = Scan(*store, "1");
    store->removal.RemoveScan(kAnna, scan, "a mistake");
    EXPECT_TRUE(exists(*store, scan));
    store->removal.WipePatient(kAnna, "1");
    EXPECT_FALSE(exists(*store, scan)) << "a wipe leaves nothing";
    // Between the row that went and the files.
    fs::create_directories(store->folders.Bin("000077") / "scene");
  }
  (void)Open();
  Change("UPDATE bin SET binned_at = binned_at - " + Us(31 * 24));
  (void)Open()->removal.RemoveOldScans(0, kWithBackup);
  EXPECT_TRUE(fs::is_empty(state() / "scans" / ".bin"));
}

TEST_F(RetentionTest, AClockFarAheadOfAllRecordsIsDoubtedUntilSomebodyHasSeenTheDate) {
  (void)OldScans(1);
  const auto is_doubted = [](Store& store) { return IsClockDoubted(*store.database().ForRows()); };
  EXPECT_FALSE(is_doubted(*Open()));
  Change("DROP TRIGGER audit_no_update; UPDATE audit SET time = time - " + Us(13 * 24));
  EXPECT_FALSE(is_doubted(*Open()));
  Change("UPDATE audit SET time = time - " + Us(2 * 24));
  EXPECT_TRUE(is_doubted(*Open()));
  const auto store = Open();
  store->audit.Log(kAnna, "note", "", Message());
  EXPECT_TRUE(is_doubted(*store)) << "what is written with that clock proves nothing";
  store->settings.Change(kAnna, store->settings.Get());
  EXPECT_FALSE(is_doubted(*store));
}

class OldCopiesTest : public RetentionTest {
 protected:
  /// A store after a restore of its own backup. @returns the patient's scan
  std::string Restored() const {
    const std::string scan = OldScans(1).front();
    Open()->users.Add(kAnna, {.name = "eva",
                              .role = Role::kEngineer,
                              .password_hash = "hush-hush",
                              .disabled = false,
                              .created_at = {}});
    (void)BackUpStopped(state(), folder_ / "backup");
    (void)RestoreOver(folder_ / "backup", state());
    return scan;
  }
  [[nodiscard]] fs::path copy() const { return state() / "before-restore-1"; }
  [[nodiscard]] std::string CopiedDatabase() const {
    return ReadTextFile(copy() / "plumb.db", 1U << 26U);
  }
};

TEST_F(OldCopiesTest, AWipeReachesWhatARestoreReplaced) {
  const std::string scan = Restored();
  ASSERT_TRUE(fs::exists(copy() / "scans" / scan / "scene"));
  const auto store = Open();
  store->removal.WipePatient(kAnna, "1");
  EXPECT_FALSE(fs::exists(copy() / "scans" / scan));
  EXPECT_FALSE(Database(copy() / "plumb.db", Database::Access::kReadOnly)
                   .Has("SELECT 1 FROM patients WHERE code = 'A'"));
}

TEST_F(OldCopiesTest, AWipeThatCannotSearchACopyChangesNothing) {
  (void)Restored();
  WriteWholeFile(copy() / "plumb.db", std::string(20'000, 'x'));
  const auto store = Open();
  EXPECT_EQ(RefusalOf([&] { store->removal.WipePatient(kAnna, "1"); }), ChangeResult::kConflict);
  EXPECT_TRUE(store->patients.FindByCode("A"));
  fs::remove_all(copy());
  store->removal.WipePatient(kAnna, "1");
  EXPECT_FALSE(store->patients.FindByCode("A"));
}

TEST_F(OldCopiesTest, ACopyWithoutChecksumsIsChangedAsItIs) {
  (void)OldScans(1);
  const fs::path plain = state() / "before-checksums";
  fs::create_directory(plain);
  {
    Database old(plain / "plumb.db", Database::Access::kUnsealed);
    Migrate(old);
    old.Run("INSERT INTO patients (code, site, created_at) VALUES ('A', '', 0), ('B', '', 0)");
    old.Execute("PRAGMA user_version = 9");  // the last schema without checksums
  }
  Open()->removal.WipePatient(kAnna, "1");
  EXPECT_EQ(KindOfDatabase(plain / "plumb.db"), DatabaseKind::kPlain);
  EXPECT_FALSE(fs::exists(plain / "before-checksums")) << "that would be one more copy";
  Database copy(plain / "plumb.db", Database::Access::kFrozen);
  EXPECT_EQ(copy.FirstText("SELECT group_concat(code) FROM patients WHERE id > 0"), "B");
}

TEST_F(OldCopiesTest, AFactoryResetRemovesTheAccountsOfCopiesToo) {
  (void)Restored();
  EXPECT_THAT(CopiedDatabase(), ::testing::HasSubstr("hush-hush"));
  WriteWholeFile(copy() / "provisioned-display", std::string("hush-hush"));
  fs::create_directory(state() / "damaged-0123");
  WriteWholeFile(state() / "damaged-0123" / "plumb.db", std::string("hush-hush"));
  RequestFactoryReset(state(), FactoryReset::kKeepRecords, kAnna);
  (void)CarryOutFactoryReset(state());
  for (const auto& [path, bytes] : testing::FilesBelow(state()))
    EXPECT_THAT(bytes, ::testing::Not(::testing::HasSubstr("hush-hush"))) << path;
  EXPECT_TRUE(Database(copy() / "plumb.db", Database::Access::kReadOnly)
                  .Has("SELECT 1 FROM patients WHERE code = 'A'"))
      << "records are kept";
}

}  // namespace
}  // namespace plumb
