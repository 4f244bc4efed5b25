// SPDX-License-Identifier: Apache-2.0
// A start never deletes what once was a finished scan, whatever a look at its files gives.
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/archive/store_backup.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using testing::FillScan;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kAnna;
using testing::kScanFiles;
using testing::MessageOf;
using testing::PlanAndApprove;
using ::testing::StartsWith;
using testing::StoreScan;

enum class Damage { kAbsent, kAbsentOnce, kTruncated, kUnreadable, kDanglingLink, kFolder };
constexpr Damage kDamages[] = {Damage::kAbsent,     Damage::kAbsentOnce,   Damage::kTruncated,
                               Damage::kUnreadable, Damage::kDanglingLink, Damage::kFolder};
const char* NameOf(Damage damage) {
  static constexpr const char* kNames[] = {"absent",     "absent once",   "truncated",
                                           "unreadable", "dangling link", "folder"};
  return kNames[static_cast<int>(damage)];
}

class StoreRecoveryTest : public ::testing::Test {
 protected:
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  [[nodiscard]] std::unique_ptr<Store> Open(StoreOptions options = {}) const {
    return std::make_unique<Store>(state(), std::move(options));
  }
  /// The number of the only scan of the only patient.
  [[nodiscard]] std::string StoreOneScan() const {
    const auto store = Open();
    return StoreScan(*store, store->patients.Add(kAnna, "P", ""));
  }
  static std::vector<std::string> Actions(Store& store) {
    std::vector<std::string> actions;
    for (const AuditEntry& entry : store.audit.Find({0, 1000}))
      actions.push_back(entry.action + " " + entry.subject + ": " + entry.detail.English());
    return actions;
  }

  testing::TempFolder folder_;
};

/// One reference and five scans, of which one file is damaged; a scan that had begun beside them.
class OneDamagedFile {
 public:
  OneDamagedFile(const fs::path& state, const std::string& file, bool of_reference, Damage damage)
      : state_(state), damage_(damage) {
    Store store(state);
    const std::string patient = store.patients.Add(kAnna, "P", "");
    reference = StoreScan(store, patient);
    (void)PlanAndApprove(store, store.references.Add(kAnna, reference, "", {}));
    for (int i = 0; i < 5; ++i) scans.push_back(StoreScan(store, patient));
    hit = of_reference ? reference : scans[2];
    FillScan(store.folders.Staging(store.scans.Begin(testing::Begun(patient))));
    path_ = store.folders.Scan(hit) / file;
    before = testing::FilesBelow(state / "scans");
    std::erase_if(before, [](const auto& entry) { return entry.first.starts_with(".staging"); });
  }

  void Break() {
    const fs::path aside = state_.parent_path() / "aside";
    if (damage_ == Damage::kUnreadable) return;
    fs::rename(path_, aside);
    if (damage_ == Damage::kTruncated) WriteWholeFile(path_, std::string_view("x"));
    if (damage_ == Damage::kDanglingLink) fs::create_symlink("nowhere", path_);
    if (damage_ == Damage::kFolder) fs::create_directory(path_);
  }
  void Mend() {
    if (damage_ == Damage::kUnreadable) return;
    fs::remove_all(path_);
    fs::rename(state_.parent_path() / "aside", path_);
  }
  /// As the start sees the disk while it is damaged.
  [[nodiscard]] StoreOptions Options() const {
    StoreOptions options;
    if (damage_ == Damage::kUnreadable) {
      options.look = [path = path_](const fs::path& file) {
        return file == path ? FileLook{.error = EIO} : LookAt(file);
      };
    }
    return options;
  }

  std::string reference, hit;
  std::vector<std::string> scans;
  std::map<std::string, std::string> before;

 private:
  fs::path state_, path_;
  Damage damage_;
};

TEST_F(StoreRecoveryTest, NoDamageToAFileOfAScanMakesAStartDeleteAnything) {
  int rounds = 0, survived = 0;
  for (const bool of_reference : {true, false}) {
    for (const std::string file : kScanFiles) {
      for (const Damage damage : kDamages) {
        SCOPED_TRACE(fmt::format("{} of a {}: {}", file, of_reference ? "reference" : "scan",
                                 NameOf(damage)));
        const testing::TempFolder folder;
        const fs::path state = folder / "state";
        OneDamagedFile damaged(state, file, of_reference, damage);
        damaged.Break();
        auto expected = damaged.before;
        if (damage != Damage::kUnreadable) expected.erase(damaged.hit + "/" + file);
        if (damage == Damage::kTruncated) expected[damaged.hit + "/" + file] = "x";
        for (int start = 0; start < 2; ++start) {
          Store store(state, damaged.Options());
          EXPECT_EQ(store.recovery().lost_scans, start == 0 ? 1 : 0);
          EXPECT_EQ(store.recovery().foreign_folders, 0);
          EXPECT_EQ(store.recovery().broken_references, of_reference ? 1 : 0);
          EXPECT_EQ(testing::FilesBelow(state / "scans"), expected);
          const auto scan = store.scans.Find(damaged.hit);
          ASSERT_TRUE(scan);
          EXPECT_TRUE(scan->folder.empty()) << "what cannot be seen whole is not shown";
          EXPECT_THAT(scan->failure.English(), HasSubstr(file));
          EXPECT_EQ(scan->outcome, ScanOutcome::kDone);
          EXPECT_TRUE(scan->result) << "its numbers are in the database";
          EXPECT_THAT(Actions(store), Contains(StartsWith("scan.unavailable " + damaged.hit)));
          if (start == 0 && damage == Damage::kAbsentOnce) break;
        }
        damaged.Mend();
        Store store(state);
        EXPECT_EQ(store.recovery().attached_scans, 1);
        EXPECT_EQ(store.scans.Find(damaged.hit)->folder, store.folders.Scan(damaged.hit));
        EXPECT_EQ(store.scans.Find(damaged.hit)->failure.English(), "");
        EXPECT_EQ(testing::FilesBelow(state / "scans"), damaged.before);
        EXPECT_THAT(Actions(store), Contains(StartsWith("scan.available " + damaged.hit)));
        ++rounds;
        if (testing::FilesBelow(state / "scans") == damaged.before) ++survived;
      }
    }
  }
  fmt::print("damaged files of references and scans: {} rounds, {} survived, {} lost\n", rounds,
             survived, rounds - survived);
  EXPECT_EQ(rounds, 2 * 7 * 6);
}

TEST_F(StoreRecoveryTest, NoDamageToAFileOfAStagingFolderHoldsItBack) {
  int rounds = 0, survived = 0;
  for (const std::string file : kScanFiles) {
    for (const Damage damage : kDamages) {
      SCOPED_TRACE(fmt::format("{}: {}", file, NameOf(damage)));
      const testing::TempFolder folder;
      std::string id, done;
      fs::path path;
      {
        Store store(folder / "state");
        const std::string patient = store.patients.Add(kAnna, "P", "");
        done = StoreScan(store, patient);
        id = store.scans.Begin(testing::Begun(patient));
        FillScan(store.folders.Staging(id));
        path = store.folders.Staging(id) / file;
        if (damage != Damage::kUnreadable) fs::remove(path);
        if (damage == Damage::kTruncated) WriteWholeFile(path, std::string_view("x"));
        if (damage == Damage::kDanglingLink) fs::create_symlink("nowhere", path);
        if (damage == Damage::kFolder) fs::create_directory(path);
      }
      StoreOptions options;
      options.look = [&](const fs::path& looked_at) {
        const bool fails = damage == Damage::kUnreadable && looked_at == path;
        return fails ? FileLook{.error = EIO} : LookAt(looked_at);
      };
      Store store(folder / "state", options);
      EXPECT_EQ(store.recovery().interrupted_scans, 1);
      EXPECT_EQ(store.recovery().orphaned_folders, 1);
      EXPECT_EQ(store.recovery().lost_scans, 0);
      EXPECT_FALSE(fs::exists(store.folders.Staging(id)));
      EXPECT_EQ(store.scans.Find(id)->outcome, ScanOutcome::kFailed);
      EXPECT_FALSE(store.scans.Find(done)->folder.empty());
      EXPECT_THAT(Actions(store), Contains(StartsWith("folder.remove .staging-" + id)));
      ++rounds;
      if (fs::exists(store.folders.Scan(done))) ++survived;
    }
  }
  fmt::print("damaged files of staging folders: {} rounds, {} with the finished scan, {} lost\n",
             rounds, survived, rounds - survived);
  EXPECT_EQ(rounds, 7 * 6);
}

/// A recording has one digest, so a start looks only whether its folder exists; the check of the
/// content notices the rest.
TEST_F(StoreRecoveryTest, NoDamageToARecordingMakesAStartDeleteAnything) {
  for (const std::string file : {"recording", "recording/rgb.txt", "recording/rgb/1.png"}) {
    for (const Damage damage :
         {Damage::kAbsent, Damage::kTruncated, Damage::kDanglingLink, Damage::kFolder}) {
      if (file == "recording" && damage == Damage::kFolder) continue;
      SCOPED_TRACE(fmt::format("{}: {}", file, NameOf(damage)));
      const testing::TempFolder folder;
      std::string scan;
      {
        Store store(folder / "state");
        const std::string patient = store.patients.Add(kAnna, "P", "");
        scan = StoreScan(store, patient, [](const fs::path& staging) {
          FillScan(staging);
          fs::create_directories(staging / "recording" / "rgb");
          WriteWholeFile(staging / "recording" / "rgb.txt", std::string_view("list"));
          WriteWholeFile(staging / "recording" / "rgb" / "1.png", std::string_view("image"));
        });
        for (int i = 0; i < 2; ++i) (void)StoreScan(store, patient);
        ASSERT_EQ(store.integrity.Check(scan, false).English(), "");
      }
      const fs::path scans = folder / "state" / "scans", path = scans / scan / file;
      const auto before = testing::FilesBelow(scans);
      fs::rename(path, folder / "aside");
      if (damage == Damage::kTruncated) WriteWholeFile(path, std::string_view("x"));
      if (damage == Damage::kDanglingLink) fs::create_symlink("nowhere", path);
      if (damage == Damage::kFolder) fs::create_directory(path);
      const auto damaged = testing::FilesBelow(scans);
      {
        Store store(folder / "state");
        EXPECT_EQ(store.recovery().lost_scans, file == "recording" ? 1 : 0);
        EXPECT_THAT(store.integrity.Check(scan, false).English(), StartsWith("recording "));
        EXPECT_EQ(store.integrity.Check(scan, /*scene_only=*/true).English(), "");
        EXPECT_EQ(testing::FilesBelow(scans), damaged);
      }
      fs::remove_all(path);
      fs::rename(folder / "aside", path);
      Store store(folder / "state");
      EXPECT_EQ(store.integrity.Check(scan, false).English(), "");
      EXPECT_EQ(store.scans.Find(scan)->folder, scans / scan);
      EXPECT_EQ(testing::FilesBelow(scans), before);
    }
  }
}

TEST_F(StoreRecoveryTest, TheFolderOfAScanMayBeALinkAndWhatStandsInItsPlaceIsKept) {
  std::string scan;
  {
    const auto store = Open();
    const std::string patient = store->patients.Add(kAnna, "P", "");
    scan = StoreScan(*store, patient);
    for (int i = 0; i < 2; ++i) (void)StoreScan(*store, patient);
  }
  const fs::path path = state() / "scans" / scan;
  fs::rename(path, folder_ / "away");
  const auto before = testing::FilesBelow(folder_ / "away");
  const auto failure = [&] { return Open()->scans.Find(scan)->failure.English(); };
  fs::create_directory_symlink(folder_ / "away", path);
  EXPECT_EQ(failure(), "");
  fs::remove(path);
  fs::create_symlink("/nonexistent/disk", path);
  EXPECT_THAT(failure(), HasSubstr("its folder is a link that leads nowhere"));
  EXPECT_TRUE(fs::is_symlink(path));
  fs::remove(path);
  WriteWholeFile(path, std::string_view("a file"));
  EXPECT_THAT(failure(), HasSubstr("its folder is not a folder"));
  EXPECT_EQ(ReadTextFile(path, 16), "a file");
  fs::remove(path);
  EXPECT_EQ(testing::FilesBelow(folder_ / "away"), before);
  fs::rename(folder_ / "away", path);
  EXPECT_EQ(failure(), "");
}

TEST_F(StoreRecoveryTest, WithoutTheFolderOfScansItIsSafeModeAndNothingIsChanged) {
  std::vector<std::string> scans;
  std::size_t entries = 0;
  {
    const auto store = Open();
    const std::string patient = store->patients.Add(kAnna, "P", "");
    for (int i = 0; i < 4; ++i) scans.push_back(StoreScan(*store, patient));
    (void)store->scans.Begin(testing::Begun(patient));  // and the power goes
    entries = Actions(*store).size();
  }
  const auto before = testing::FilesBelow(state() / "scans");
  fs::rename(state() / "scans", folder_ / "disk");
  for (int start = 0; start < 2; ++start) {
    EXPECT_THAT(MessageOf<ScansMissing>([&] { (void)Open(); }),
                AllOf(HasSubstr("4 of 4"), HasSubstr("mounted"), HasSubstr(scans[0])));
    EXPECT_FALSE(fs::exists(state() / "scans"));
    const auto readable = Store::OpenReadable(state());
    EXPECT_EQ(Actions(*readable).size(), entries);
    EXPECT_EQ(readable->scans.Find("5")->outcome, ScanOutcome::kRunning);
  }
  fs::rename(folder_ / "disk", state() / "scans");
  const auto store = Open();
  EXPECT_EQ(store->recovery().lost_scans, 0);
  for (const std::string& scan : scans) EXPECT_FALSE(store->scans.Find(scan)->folder.empty());
  EXPECT_EQ(testing::FilesBelow(state() / "scans"), before);
}

TEST_F(StoreRecoveryTest, HalfOfTheScansIsSafeModeAndLessIsNot) {
  std::vector<std::string> scans;
  {
    const auto store = Open();
    const std::string patient = store->patients.Add(kAnna, "P", "");
    for (int i = 0; i < 5; ++i) scans.push_back(StoreScan(*store, patient));
  }
  const auto hide = [&](std::size_t n) {
    StoreOptions options;
    options.look = [this, &scans, n](const fs::path& path) {
      for (std::size_t i = 0; i < n; ++i) {
        if (path == state() / "scans" / scans[i]) return FileLook{.error = EACCES};
      }
      return LookAt(path);
    };
    return options;
  };
  EXPECT_THROW((void)Open(hide(3)), ScansMissing);
  EXPECT_EQ(Open(hide(2))->recovery().lost_scans, 2) << "2 of 5 are less than half";
  EXPECT_EQ(Open(hide(3))->recovery().lost_scans, 1) << "1 more of the 3 that were seen";
  EXPECT_THROW((void)Open(hide(5)), ScansMissing) << "2 of 2";
  EXPECT_EQ(Open()->recovery().attached_scans, 3);
}

TEST_F(StoreRecoveryTest, APersonSaysThatTheFilesAreGoneForGood) {
  {
    const auto store = Open();
    const std::string patient = store->patients.Add(kAnna, "P", "");
    for (int i = 0; i < 3; ++i) fs::remove_all(store->folders.Scan(StoreScan(*store, patient)));
  }
  EXPECT_THAT(MessageOf<ScansMissing>([&] { (void)Open(); }), HasSubstr("scans-are-lost"));
  WriteWholeFile(state() / "scans-are-lost", std::string_view());
  EXPECT_EQ(Open()->recovery().lost_scans, 3);
  EXPECT_FALSE(fs::exists(state() / "scans-are-lost")) << "it counts once";
  EXPECT_EQ(Open()->recovery().lost_scans, 0);
}

TEST_F(StoreRecoveryTest, TheNumberOfLostScansIsConfirmedAndNoOther) {
  std::vector<std::string> scans;
  {
    const auto store = Open();
    const std::string patient = store->patients.Add(kAnna, "P", "");
    for (int i = 0; i < 5; ++i) scans.push_back(StoreScan(*store, patient));
  }
  fs::create_directories(folder_ / "away");
  for (int i = 0; i < 3; ++i) fs::rename(state() / "scans" / scans[i], folder_ / "away" / scans[i]);
  const auto before = testing::FilesBelow(state() / "scans");
  for (const int number : {2, 4, 5}) {
    ConfirmLostScans(state(), number);
    EXPECT_THAT(MessageOf<ScansMissing>([&] { (void)Open(); }),
                AllOf(HasSubstr("3 of 5"), HasSubstr("lost_scans = 3"),
                      HasSubstr(fmt::format("not for \"{}\"", number))));
  }
  ConfirmLostScans(state(), 3);
  {
    const auto store = Open();
    EXPECT_EQ(store->recovery().lost_scans, 3);
    EXPECT_EQ(testing::FilesBelow(state() / "scans"), before) << "nothing is deleted";
    const auto entries = store->audit.Find({0, 10, "scans.lost"});
    ASSERT_EQ(entries.size(), 1U);
    EXPECT_EQ(entries[0].detail.English(), "3 of 5 stored scans were confirmed as lost");
    EXPECT_EQ(store->audit.FirstBroken(), std::nullopt);
  }
  EXPECT_FALSE(fs::exists(state() / "scans-are-lost")) << "it counts once";
  for (int i = 0; i < 3; ++i) fs::rename(folder_ / "away" / scans[i], state() / "scans" / scans[i]);
  EXPECT_EQ(Open()->recovery().attached_scans, 3) << "and they may come back";
}

TEST_F(StoreRecoveryTest, AConfirmationFollowsNoLink) {
  fs::create_directories(state());
  WriteWholeFile(folder_ / "other", std::string_view("kept"));
  fs::create_symlink(folder_ / "other", state() / ".scans-are-lost.new");
  ConfirmLostScans(state(), 3);
  EXPECT_EQ(ReadTextFile(folder_ / "other", 16), "kept");
  EXPECT_EQ(ReadTextFile(state() / "scans-are-lost", 16), "3");
  EXPECT_FALSE(fs::is_symlink(state() / "scans-are-lost"));
}

TEST_F(StoreRecoveryTest, AConfirmationOfNothingLostCountsForNoLaterStart) {
  {
    const auto store = Open();
    const std::string patient = store->patients.Add(kAnna, "P", "");
    for (int i = 0; i < 3; ++i) (void)StoreScan(*store, patient);
  }
  ConfirmLostScans(state(), 3);
  EXPECT_TRUE(Open()->audit.Find({0, 10, "scans.lost"}).empty());
  fs::rename(state() / "scans", folder_ / "disk");
  EXPECT_THROW((void)Open(), ScansMissing);
}

TEST_F(StoreRecoveryTest, TheOnlyScanMayBeMissingBesideOtherFilesAndComesBack) {
  const std::string scan = StoreOneScan();
  fs::rename(state() / "scans" / scan, folder_ / "away");
  WriteWholeFile(state() / "scans" / "note", std::string_view("this is the disk"));
  EXPECT_EQ(Open()->recovery().lost_scans, 1);
  fs::rename(folder_ / "away", state() / "scans" / scan);
  EXPECT_EQ(Open()->recovery().attached_scans, 1);
  EXPECT_EQ(Open()->scans.Find(scan)->folder, state() / "scans" / scan);
}

TEST_F(StoreRecoveryTest, AnEmptyOrMissingFolderOfScansIsSafeModeEvenForTheOnlyScan) {
  const std::string scan = StoreOneScan();
  const fs::path scans = state() / "scans";
  fs::rename(scans, folder_ / "disk");
  const auto refuses = [&] { return MessageOf<ScansMissing>([&] { (void)Open(); }); };
  EXPECT_THAT(refuses(), AllOf(HasSubstr("1 of 1"), HasSubstr("mounted"), HasSubstr(scan)));
  EXPECT_FALSE(fs::exists(scans));
  fs::create_directory(scans);
  EXPECT_THAT(refuses(), HasSubstr("1 of 1"));
  fs::create_directory(scans / "lost+found");
  EXPECT_THAT(refuses(), HasSubstr("1 of 1")) << "of an empty disk";
  fs::remove_all(scans);
  fs::create_symlink("/nonexistent/disk", scans);
  EXPECT_THAT(refuses(), HasSubstr("1 of 1")) << "a link that leads nowhere";
  ConfirmLostScans(state(), 1);
  fs::remove(scans);
  EXPECT_EQ(Open()->recovery().lost_scans, 1) << "as a person has confirmed";
  fs::remove_all(scans);
  fs::rename(folder_ / "disk", scans);
  EXPECT_EQ(Open()->recovery().attached_scans, 1);
}

TEST_F(StoreRecoveryTest, TheFolderOfScansMayBeALinkAndAFileInItsPlaceIsSafeMode) {
  const std::string scan = StoreOneScan();
  const fs::path scans = state() / "scans";
  fs::rename(scans, folder_ / "disk");
  const auto before = testing::FilesBelow(folder_ / "disk");
  fs::create_directory_symlink(folder_ / "disk", scans);
  EXPECT_EQ(Open()->scans.Find(scan)->folder, scans / scan);
  EXPECT_EQ(Open()->integrity.Check(scan, false).English(), "");
  fs::remove(scans);
  WriteWholeFile(scans, std::string_view("a file"));
  EXPECT_THROW((void)Open(), DiskRefused);
  EXPECT_EQ(ReadTextFile(scans, 16), "a file");
  EXPECT_EQ(testing::FilesBelow(folder_ / "disk"), before);
}

/// As when a backup of yesterday is tried, and then today's.
TEST_F(StoreRecoveryTest, WhatAnOlderDatabaseSetAsideComesBackWithTheNewerOne) {
  std::string old_scan, scan, changed;
  {
    const auto store = Open();
    old_scan = StoreScan(*store, store->patients.Add(kAnna, "P", ""));
  }
  fs::copy_file(state() / "plumb.db", folder_ / "older");
  {
    const auto store = Open();
    scan = StoreScan(*store, "1");
    changed = StoreScan(*store, "1");
  }
  const auto before = testing::FilesBelow(state() / "scans" / scan);
  fs::rename(state() / "plumb.db", folder_ / "newer");
  fs::rename(folder_ / "older", state() / "plumb.db");
  const auto without_notes = [&] {  // as a restore leaves it
    for (const char* beside : {"plumb.db-mark", "plumb.db-seals"}) fs::remove(state() / beside);
  };
  without_notes();
  {
    const auto store = Open();
    EXPECT_EQ(store->recovery().foreign_folders, 2);
    EXPECT_EQ(store->integrity.CountUnusable().set_aside, 2);
    EXPECT_FALSE(store->scans.Find(scan));
  }
  WriteWholeFile(state() / "set-aside" / changed / "scene" / "mesh.ply",
                 std::string(before.at("scene/mesh.ply").size(), 'x'));
  fs::rename(folder_ / "newer", state() / "plumb.db");
  without_notes();
  const auto store = Open();
  EXPECT_EQ(store->recovery().attached_scans, 1);
  EXPECT_EQ(store->scans.Find(scan)->folder, store->folders.Scan(scan));
  EXPECT_EQ(testing::FilesBelow(store->folders.Scan(scan)), before);
  EXPECT_EQ(store->integrity.Check(scan, false).English(), "");
  EXPECT_EQ(store->scans.Find(old_scan)->folder, store->folders.Scan(old_scan));
  EXPECT_THAT(Actions(*store),
              Contains(AllOf(StartsWith("folder.return " + scan), HasSubstr("set-aside/" + scan))));
  EXPECT_EQ(store->recovery().lost_scans, 1) << "what differs is not the scan that was stored";
  EXPECT_TRUE(store->scans.Find(changed)->folder.empty());
  EXPECT_TRUE(fs::exists(state() / "set-aside" / changed));
  EXPECT_EQ(store->integrity.CountUnusable().set_aside, 1);
}

TEST_F(StoreRecoveryTest, ACompleteFolderOfAScanThatNoRowKnowsToHaveEndedIsSetAside) {
  std::string id;
  {
    const auto store = Open();
    id = store->scans.Begin(testing::Begun(store->patients.Add(kAnna, "A", "")));
    FillScan(store->folders.Staging(id));
    fs::rename(store->folders.Staging(id), store->folders.Scan(id));  // and here the power goes
  }
  const auto store = Open();
  EXPECT_EQ(store->recovery().orphaned_folders, 0);
  EXPECT_EQ(store->recovery().foreign_folders, 1);
  EXPECT_FALSE(fs::exists(store->folders.Scan(id)));
  EXPECT_TRUE(fs::exists(state() / "set-aside" / (id + "-interrupted") / "scene" / "scene.json"));
  EXPECT_EQ(store->scans.Find(id)->outcome, ScanOutcome::kFailed);
  // Where scans/ is a disk of its own; or a second one of this number.
  const fs::path on_disk = store->folders.scans() / "set-aside" / (id + "-interrupted-2");
  fs::create_directories(on_disk.parent_path());
  fs::copy(state() / "set-aside" / (id + "-interrupted"), on_disk, fs::copy_options::recursive);
  (void)StoreBackup(*store).Make(kAnna, folder_ / "backup");
  EXPECT_THAT(testing::FilesBelow(folder_ / "backup" / "scans" / "set-aside"),
              ::testing::SizeIs(7));
  store->removal.WipePatient(kAnna, store->patients.FindByCode("A")->id);
  for (const fs::path& aside : store->folders.SetAside())
    EXPECT_THAT(testing::FilesBelow(aside), IsEmpty()) << "the patient's too";
}

TEST_F(StoreRecoveryTest, WhatWasRemovedOnPurposeAndCameBackGoesAtTheNextStart) {
  std::string scan;
  {
    const auto store = Open();
    const std::string patient = store->patients.Add(kAnna, "A", "");
    scan = StoreScan(*store, patient);
    fs::copy(store->folders.Scan(scan), folder_ / "copy", fs::copy_options::recursive);
    store->removal.WipePatient(kAnna, patient);
    fs::rename(folder_ / "copy", store->folders.Scan(scan));  // as if the power had gone before
  }
  const auto store = Open();
  EXPECT_EQ(store->recovery().orphaned_folders, 1);
  EXPECT_FALSE(fs::exists(store->folders.Scan(scan)));
  EXPECT_THAT(Actions(*store), Contains(StartsWith("folder.remove " + scan)));
}

TEST_F(StoreRecoveryTest, AFolderOfANumberThatWasGivenOutAndHasNoRowIsSetAside) {
  const std::string scan = "000001";
  {
    const auto store = Open();
    ASSERT_EQ(StoreScan(*store, store->patients.Add(kAnna, "A", "")), scan);
  }
  {
    Database direct(state() / "plumb.db", Database::Access::kReadWrite);
    direct.Execute("DELETE FROM scans");  // by no function of the store
  }
  EXPECT_EQ(Open()->recovery().foreign_folders, 1);
  EXPECT_THAT(testing::FilesBelow(state() / "set-aside" / scan), ::testing::SizeIs(7));
}

TEST_F(StoreRecoveryTest, AStoreOfTheFirstVersionKeepsScansThatItHadGivenUp) {
  std::string kept, given_up;
  {
    const auto store = Open();
    const std::string patient = store->patients.Add(kAnna, "A", "");
    kept = StoreScan(*store, patient);
    given_up = StoreScan(*store, patient);
  }
  testing::MakeSchema3(state() / "plumb.db");
  Database(state() / "plumb.db", Database::Access::kReadWrite)
      .Execute("UPDATE scans SET has_folder = 0, failure = 'its files are gone' WHERE id = 2");
  const auto store = Open();
  EXPECT_EQ(store->recovery().orphaned_folders, 0);
  EXPECT_EQ(store->recovery().attached_scans, 1);
  for (const std::string& scan : {kept, given_up}) {
    EXPECT_EQ(store->scans.Find(scan)->folder, store->folders.Scan(scan));
    EXPECT_EQ(store->scans.Find(scan)->failure.English(), "");
    EXPECT_EQ(store->integrity.Check(scan, false).English(), "") << "first seen";
    WriteWholeFile(store->folders.Scan(scan) / "scene" / "mesh.ply", std::string_view("another"));
    EXPECT_THAT(store->integrity.Check(scan, false).English(), HasSubstr("scene/mesh.ply"));
  }
  EXPECT_EQ(store->audit.FirstBroken(), std::nullopt) << "older entries have no chain";
}

}  // namespace
}  // namespace plumb
