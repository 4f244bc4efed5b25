// Which scans are removed with time, and what is left of a scan that could not be stored.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/records/schema.hpp"
#include "tests/support/full_disk.hpp"
#include "tests/unit/records/store_fixture.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using testing::kAnna;
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
  EXPECT_EQ(store->removal.RemoveOldScans(0), 0) << "0: never";
  EXPECT_EQ(store->removal.RemoveOldScans(30), 1);
  EXPECT_EQ(store->scans.Find(old), std::nullopt);
  EXPECT_FALSE(fs::exists(store->folders.Scan(old)));
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
  EXPECT_EQ(store->removal.RemoveOldScans(30), 0);
  for (const std::string& scan : {first, last}) stamp(scan, "1000000");
  EXPECT_EQ(store->removal.RemoveOldScans(30), 4) << "a stamp of the future keeps nothing for ever";
}

TEST_F(StoreTest, CareEndsSoonWhenItIsTold) {
  const auto store = Open();
  (void)Scan(*store, store->patients.Add(kAnna, "A", ""));
  Database(database(), Database::Access::kReadWrite).Execute("UPDATE scans SET started_at = 0");
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(store->removal.RemoveOldScans(30, stop.get_token()), 0);
  EXPECT_EQ(store->removal.KeepWithinQuota(0, stop.get_token()), 0);
  EXPECT_EQ(store->removal.KeepWithinQuota(0), 1);
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
  EXPECT_EQ(store->removal.KeepWithinQuota(7000), 0);
  EXPECT_GT(store->removal.KeepWithinQuota(5100), 0);
  EXPECT_FALSE(fs::exists(store->folders.Scan(reference_scan) / "recording"));
  EXPECT_TRUE(store->scans.Find(old));
  (void)store->removal.KeepWithinQuota(2100);
  EXPECT_EQ(store->scans.Find(old), std::nullopt);
  EXPECT_TRUE(store->scans.Find(fresh));
  (void)store->removal.KeepWithinQuota(0);
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
  EXPECT_EQ(store->removal.RemoveOldScans(30), 2) << "a changed one is as old as any other";
  EXPECT_TRUE(store->scans.Find(out_of_sight));
  EXPECT_EQ(store->scans.Find(in_sight), std::nullopt);
  EXPECT_EQ(store->scans.Find(changed), std::nullopt);
  (void)Scan(*store, patient);
  EXPECT_EQ(store->removal.KeepWithinQuota(0), 1) << "the one that is in sight";
  EXPECT_TRUE(store->scans.Find(out_of_sight));
  fs::rename(elsewhere, store->folders.Scan(out_of_sight));
  Database(database(), Database::Access::kReadWrite).Execute("UPDATE scans SET unavailable = ''");
  EXPECT_EQ(store->removal.KeepWithinQuota(0), 2) << "its recording and itself";
}

TEST_F(StoreTest, TheLogSaysWhetherAgeOrTheQuotaRemovedAScan) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "A", "");
  const auto reason = [&] { return store->audit.Find({0, 1, "scan.remove"}).at(0).detail; };
  (void)Scan(*store, patient);
  EXPECT_EQ(store->removal.KeepWithinQuota(0), 1);
  EXPECT_EQ(reason(), "quota");
  (void)Scan(*store, patient);
  Database(database(), Database::Access::kReadWrite).Execute("UPDATE scans SET started_at = 0");
  EXPECT_EQ(store->removal.RemoveOldScans(30), 1);
  EXPECT_EQ(reason(), "retention");
}

TEST_F(StoreTest, WithoutAQuotaScansTakeNineTenthsOfTheRoomThatOtherFilesLeave) {
  EXPECT_EQ(DefaultQuota(9'000, 1'000), 9'000U);
  EXPECT_EQ(DefaultQuota(0, 1'000), 900U);
  EXPECT_EQ(DefaultQuota(1'000, 0), 900U);
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "A", "");
  const auto add = [&](int count) {
    for (int i = 0; i < count; ++i)
      WriteWholeFile(store->folders.Scan(Scan(*store, patient)) / "scene" / "scene.json",
                     std::string(1000, '{'));
  };
  add(9);
  const std::string first = store->scans.List(patient, 100).back().id;
  std::uint64_t free = 1'000;
  const auto grows = [&] { return free++; };
  EXPECT_EQ(store->removal.KeepWithinRoom(grows).num_removed, 0) << "9000 of 10000 bytes";
  EXPECT_TRUE(store->scans.Find(first));
  free = 999;
  EXPECT_EQ(store->removal.KeepWithinRoom(grows).num_removed, 1) << "one byte less is free";
  EXPECT_EQ(store->scans.Find(first), std::nullopt);
  add(22);
  free = 0;
  const StoreRemoval::Room enough = store->removal.KeepWithinRoom(grows);
  EXPECT_EQ(enough.num_removed, 3) << "27000 of 30000 bytes stay where another program fills it";
  EXPECT_TRUE(enough.has_helped);
  add(3);
  const StoreRemoval::Room useless = store->removal.KeepWithinRoom([] { return 0U; });
  EXPECT_EQ(useless.num_removed, 1) << "what it frees is gone at once, or was shared";
  EXPECT_FALSE(useless.has_helped);
  EXPECT_EQ(store->scans.List(patient, 100).size(), 29U);
}

}  // namespace
}  // namespace plumb
