// SPDX-License-Identifier: Apache-2.0
// State folders that are of an earlier time than the unit, and accounts that are gone.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "daemon/archive/backup.hpp"
#include "daemon/archive/factory_reset.hpp"
#include "daemon/archive/store_backup.hpp"
#include "daemon/state_folder/outside_note.hpp"
#include "daemon/state_folder/scan_numbers.hpp"
#include "tests/unit/records/store_fixture.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::kAnna;

class OutsideNoteTest : public testing::StoreTest {
 protected:
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  [[nodiscard]] fs::path outside() const { return folder_ / "backups"; }
  /// As the appliance does it. @returns how many entries are lost
  std::int64_t Note() const {
    fs::create_directories(outside());
    const auto store = Open();
    const OutsideNote note = ReadOutsideNote(outside()).value_or(OutsideNote{});
    NumberScansAbove(*store->database().ForChanges(), note.last_scan);
    const std::int64_t lost = LostEntries(*store->database().ForLists(), note);
    if (lost == 0) WriteOutsideNote(outside(), Renewed(*store->database().ForLists(), note));
    return lost;
  }
  std::string ScanOnce() const {
    const auto store = Open();
    return Scan(*store, store->patients.FindByCode("A")->id);
  }
  void AddPatient() const { (void)Open()->patients.Add(kAnna, "A", ""); }
  [[nodiscard]] std::string WhyNotOpened() const {
    try {
      (void)Open();
    } catch (const DatabaseCorrupt& error) {
      return error.what();
    }
    return {};
  }
};

TEST_F(OutsideNoteTest, AStateFolderOfAnEarlierTimeIsNoticedUntilTheNoteIsRemoved) {
  AddPatient();
  EXPECT_EQ(Note(), 0) << "the first note";
  EXPECT_EQ(ScanOnce(), "000001");
  EXPECT_EQ(Note(), 0);
  fs::copy(state(), folder_ / "snapshot", fs::copy_options::recursive);
  {
    const auto store = Open();
    for (int i = 0; i < 3; ++i) store->audit.Log(kAnna, "note", "", Message());
  }
  EXPECT_EQ(ScanOnce(), "000002");
  EXPECT_EQ(Note(), 0);
  fs::remove_all(state());
  fs::rename(folder_ / "snapshot", state());
  EXPECT_EQ(Note(), 3);
  EXPECT_EQ(Note(), 3) << "it does not hide itself";
  EXPECT_EQ(ScanOnce(), "000003") << "000002 may be printed on a report";
  fs::remove(outside() / kOutsideNote);
  EXPECT_EQ(Note(), 0);
}

TEST_F(OutsideNoteTest, ARestoredBackupAndAFactoryResetExplainWhatIsMissing) {
  AddPatient();
  EXPECT_EQ(Note(), 0);
  (void)BackUpStopped(state(), outside() / "plumb-1");
  {
    const auto store = Open();
    for (int i = 0; i < 3; ++i) store->audit.Log(kAnna, "note", "", Message());
  }
  EXPECT_EQ(Note(), 0);
  (void)RestoreOver(outside() / "plumb-1", state());
  EXPECT_EQ(Note(), 0);
  fs::copy(state(), folder_ / "snapshot", fs::copy_options::recursive);
  Open()->audit.Log(kAnna, "note", "", Message());
  EXPECT_EQ(Note(), 0);
  fs::remove_all(state());
  fs::rename(folder_ / "snapshot", state());
  EXPECT_EQ(Note(), 1) << "the restore was before that";
  RequestFactoryReset(state(), FactoryReset::kWipe, kAnna);
  (void)CarryOutFactoryReset(state());
  EXPECT_EQ(Note(), 0);
}

TEST_F(OutsideNoteTest, WhatIsNoNoteIsRefused) {
  fs::create_directories(outside());
  EXPECT_EQ(ReadOutsideNote(outside()), std::nullopt);
  for (const std::string text : {"", "{}", R"({"last_scan": "1", "audit_log": []})",
                                 R"({"last_scan": 1, "audit_log": [{"entry": 1}]})"}) {
    WriteWholeFile(outside() / kOutsideNote, text);
    EXPECT_THROW((void)ReadOutsideNote(outside()), DataError) << text;
  }
}

TEST_F(OutsideNoteTest, NoNumberOfAScanIsGivenTwiceAfterAnOlderBackupWasRestored) {
  AddPatient();
  EXPECT_EQ(ScanOnce(), "000001");
  (void)BackUpStopped(state(), outside() / "plumb-1");
  EXPECT_EQ(ScanOnce(), "000002");
  EXPECT_EQ(ScanOnce(), "000003");
  (void)RestoreOver(outside() / "plumb-1", state());
  fs::remove(state() / kLastScan);
  EXPECT_EQ(ScanOnce(), "000004") << "by the folders that were replaced";
  (void)RestoreOver(outside() / "plumb-1", state());
  for (const char* replaced : {"before-restore-1", "before-restore-2"})
    fs::remove_all(state() / replaced);
  EXPECT_EQ(ScanOnce(), "000005") << "by the note";
  fs::create_directories(state() / "set-aside" / "000009-interrupted");
  fs::create_directories(state() / "set-aside" / "9999999999");
  fs::create_directories(state() / "set-aside" / "12");
  EXPECT_EQ(ScanOnce(), "000010");
}

TEST_F(OutsideNoteTest, AUnitThatWasInUseIsNeverANewOne) {
  AddPatient();
  (void)ScanOnce();
  {
    const auto store = Open();
    store->removal.WipePatient(kAnna, store->patients.FindByCode("A")->id);
  }
  for (const char* name :
       {"plumb.db", "plumb.db-wal", "plumb.db-shm", "plumb.db-mark", "plumb.db-seals"})
    fs::remove(state() / name);
  EXPECT_THAT(WhyNotOpened(), HasSubstr("has been in use"));
  fs::remove(state() / "plumb.db");
  fs::remove_all(state());
  EXPECT_EQ(WhyNotOpened(), "") << "a new folder is a new unit";
}

TEST_F(OutsideNoteTest, AccountsGoOnlyByAFactoryReset) {
  Open()->users.Add(kAnna, {.name = "eva",
                            .role = Role::kEngineer,
                            .password_hash = "x",
                            .disabled = false,
                            .created_at = {}});
  EXPECT_EQ(WhyNotOpened(), "");
  fs::copy(state(), folder_ / "copy", fs::copy_options::recursive);
  Database(database(), Database::Access::kReadWrite).Execute("DELETE FROM users");
  EXPECT_THAT(WhyNotOpened(), HasSubstr("all accounts are gone"));
  fs::remove_all(state());
  fs::rename(folder_ / "copy", state());
  RequestFactoryReset(state(), FactoryReset::kKeepRecords, kAnna);
  (void)CarryOutFactoryReset(state());
  EXPECT_EQ(WhyNotOpened(), "");
  EXPECT_TRUE(Open()->users.List().empty());
}

}  // namespace
}  // namespace plumb
