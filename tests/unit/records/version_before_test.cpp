// SPDX-License-Identifier: Apache-2.0
// What 0.2.0 has stored in this version, and in 0.2.0 again after the update was given up.
#include <cstdlib>
#include <map>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sodium/crypto_pwhash.h>

#include "daemon/database/schema.hpp"
#include "daemon/state_folder/outside_note.hpp"
#include "daemon/state_folder/restore_note.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/process.hpp"
#include "tests/unit/records/store_fixture.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::kAnna;
using testing::MessageOf;

constexpr const char* kPatient = "2";  // of the database that 0.2.0 wrote
constexpr const char* kSigned = "64017020852a95ce1c4a9a379dcedb0be1df3fd322b53e28355a1115c3ce594e";

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

  /// The database that the program of 0.2.0 itself wrote, and that the files of its scans are lost.
  void MakeDatabaseOfTheProgram() const {
    constexpr std::size_t kLongest = std::size_t{1} << 20U;
    fs::create_directories(state());
    Database(database(), Database::Access::kUnsealed)
        .Execute(
            ReadTextFile(PLUMB_SOURCE_DIR "/tests/unit/records/data/state-0.2.0.sql", kLongest));
    WriteWholeFile(state() / "scans-are-lost", std::string_view());
  }

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

TEST_F(VersionBeforeTest, WhatTheProgramItselfWroteIsReadInThisOne) {
  MakeDatabaseOfTheProgram();
  const auto store = Open();
  const std::map<std::string, std::pair<Role, std::string>> people = {
      {"eng", {Role::kEngineer, "correct horse eng"}},
      {"phy", {Role::kPhysicist, "correct horse phy"}},
      {"phy2", {Role::kPhysicist, "correct horse ph2"}},
      {"tec", {Role::kTechnician, "correct horse tec"}}};
  for (const auto& [name, person] : people) {
    const auto account = store->users.Find(name);
    ASSERT_TRUE(account) << name;
    EXPECT_EQ(account->role, person.first) << name;
    EXPECT_EQ(crypto_pwhash_str_verify(account->password_hash.c_str(), person.second.c_str(),
                                       person.second.size()),
              0)
        << name;
  }
  const auto reference = store->references.Approved(kPatient);
  ASSERT_TRUE(reference);
  EXPECT_EQ(reference->digest, kSigned);
  EXPECT_EQ(reference->approved_by, "phy2");
  EXPECT_EQ(reference->plan.tolerance.shift_mm, 5.5);
  Database direct(database(), Database::Access::kReadOnly);
  EXPECT_EQ(direct.FirstText("SELECT approved_digest FROM refs"), kSigned) << "out of the log";
  EXPECT_EQ(store->scans.Find("000002")->result->verdict, Verdict::kMove);
  EXPECT_FALSE(store->audit.FirstBroken());
  EXPECT_EQ(store->audit.Find({0, 9, "rows.sign"}).size(), 1U);
}

// 0.2.0 noticed no such byte; the log of then says what was signed.
TEST_F(VersionBeforeTest, APlanThatChangedBeforeTheConversionIsNotUsed) {
  MakeDatabaseOfTheProgram();
  Database(database(), Database::Access::kUnsealed)
      .Execute(
          "DROP TRIGGER refs_immutable; UPDATE refs SET plan = replace(plan, ':5.5', ':7.5'); "
          "CREATE TRIGGER refs_immutable BEFORE UPDATE ON refs WHEN OLD.approved_by <> '' BEGIN "
          "SELECT RAISE(ABORT, 'an approved reference is never changed'); END;");
  const auto store = Open();
  EXPECT_THAT(MessageOf<DataError>([&] { (void)store->references.Approved(kPatient); }),
              HasSubstr("approved"));
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
