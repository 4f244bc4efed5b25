// SPDX-License-Identifier: Apache-2.0
// What 0.2.0 has stored in this version, and in 0.2.0 again after the update was given up.
#include <cstdlib>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/database/schema.hpp"
#include "daemon/state_folder/outside_note.hpp"
#include "daemon/state_folder/restore_note.hpp"
#include "tests/support/process.hpp"
#include "tests/unit/records/store_fixture.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using testing::kAnna;

/// A database as 0.2.0 has it, without checksums.
void MakeOldDatabase(const fs::path& file) {
  fs::create_directories(file.parent_path());
  Database old(file, Database::Access::kUnsealed);
  Migrate(old);
  old.Execute(testing::kToSchema9);
  old.Run(
      "INSERT INTO users (name, role, password_hash, created_at) VALUES ('eva', 'engineer', 'x', "
      "1)");
  old.Run("INSERT INTO patients (code, site, created_at) VALUES ('A', 'thorax', 1)");
}

class VersionBeforeTest : public testing::StoreTest {
 protected:
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  [[nodiscard]] fs::path kept() const { return state() / "before-checksums" / "plumb.db"; }
  [[nodiscard]] fs::path aside() const { return state() / "before-restore-1"; }

  /// By the script of the health gate; no service runs here that it could stop.
  void PutBack() const {
    const fs::path programs = folder_ / "programs";
    fs::create_directories(programs);
    WriteWholeFile(programs / "systemctl", std::string_view("#!/bin/sh\n"));
    fs::permissions(programs / "systemctl", fs::perms::owner_all);
    const RunResult done = plumb::Run(
        {"/usr/bin/env", "PATH=" + programs.string() + ":" + std::getenv("PATH"),
         "PLUMB_STATE=" + state().string(), PLUMB_SOURCE_DIR "/systemd/health-gate", "put-back"});
    ASSERT_EQ(done.exit_code, 0) << done.err;
  }
  /// A start of 0.2.0, which knows the note of a restore, too.
  void StartOld() const {
    Database old(database(), Database::Access::kUnsealed);
    EXPECT_EQ(old.FirstInteger("PRAGMA user_version"), 9);
    NoteRestore(state(), old);
  }
};

TEST_F(VersionBeforeTest, ToThisAndBackAndToThisAgain) {
  MakeOldDatabase(database());
  {
    const auto store = Open();
    EXPECT_EQ(store->users.Find("eva")->role, Role::kEngineer);
    EXPECT_TRUE(store->patients.FindByCode("A"));
    (void)store->patients.Add(kAnna, "of this version", "");
  }
  PutBack();
  StartOld();
  {
    Database old(database(), Database::Access::kUnsealed);
    EXPECT_FALSE(old.Has("SELECT 1 FROM patients WHERE code = 'of this version'"));
    old.Run("INSERT INTO patients (code, site, created_at) VALUES ('B', 'thorax', 2)");
    old.Run("UPDATE users SET password_hash = 'changed meanwhile'");
  }
  const auto store = Open();
  EXPECT_EQ(store->users.Find("eva")->password_hash, "changed meanwhile");
  for (const char* code : {"A", "B"}) EXPECT_TRUE(store->patients.FindByCode(code)) << code;
  EXPECT_FALSE(store->audit.FirstBroken());
  Database copy(kept(), Database::Access::kFrozen);
  EXPECT_TRUE(copy.Has("SELECT 1 FROM patients WHERE code = 'B'"));
  Database since(aside() / "plumb.db", Database::Access::kFrozen);
  EXPECT_TRUE(since.Has("SELECT 1 FROM patients WHERE code = 'of this version'"));
}

// Beside the backups stands what the log of this version said before it was given up.
TEST_F(VersionBeforeTest, AReturnIsNotTakenForAFolderThatAStrangerRolledBack) {
  MakeOldDatabase(database());
  OutsideNote note;
  {
    const auto store = Open();
    (void)store->patients.Add(kAnna, "of this version", "");
    note = Renewed(*store->database().ForLists(), {});
  }
  PutBack();
  StartOld();
  const auto store = Open();
  EXPECT_EQ(LostEntries(*store->database().ForLists(), note), 0);
  const auto restored = store->audit.Find({0, 9, "backup.restore"});
  ASSERT_EQ(restored.size(), 1U);
  EXPECT_NE(restored[0].detail.English().find(kept().string()), std::string::npos)
      << restored[0].detail.English();
}

TEST_F(VersionBeforeTest, ASecondConversionThatIsCutOffIsContinued) {
  MakeOldDatabase(database());
  (void)Open();
  PutBack();
  StartOld();
  {
    Database cut_off(database(), Database::Access::kReadWrite);
    Migrate(cut_off);
  }
  EXPECT_EQ(Open()->users.Find("eva")->role, Role::kEngineer) << "its rows have no digests yet";
}

}  // namespace
}  // namespace plumb
