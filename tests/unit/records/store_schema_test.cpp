// SPDX-License-Identifier: Apache-2.0
// Databases of older and newer versions, and damaged ones.
#include <fstream>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/database/scan_digests.hpp"
#include "daemon/database/schema.hpp"
#include "daemon/records/check_json.hpp"
#include "tests/support/message_of.hpp"
#include "tests/unit/records/store_fixture.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::kAnna;
using testing::kResult;
using testing::MessageOf;
using ::testing::SizeIs;
using testing::StoreTest;

TEST_F(StoreTest, ADamagedDatabaseIsToldWithWhatToDo) {
  (void)Open();
  WriteWholeFile(database(), std::string(20000, 'x'));
  EXPECT_THAT(MessageOf<DatabaseCorrupt>([&] { (void)Open(); }),
              ::testing::AllOf(HasSubstr("plumb.db"), HasSubstr("backup")));
}

TEST_F(StoreTest, ADamagedPageIsFoundAtTheStart) {
  {
    const auto store = Open();
    for (int i = 0; i < 500; ++i)
      store->audit.Log(kAnna, "note", std::to_string(i), std::string(100, 'n'));
  }
  const auto size = fs::file_size(database());
  ASSERT_GT(size, 40000U);
  std::fstream file(database(), std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(static_cast<std::streamoff>(size / 2));
  file << std::string(8192, '\x55');
  file.close();
  EXPECT_THROW((void)Open(), DatabaseCorrupt);
}

TEST_F(StoreTest, ADatabaseOfANewerVersionIsRefused) {
  (void)Open();
  {
    Database direct(database(), Database::Access::kReadWrite);
    direct.Execute("DELETE FROM settings; PRAGMA user_version = 99");  // it says nothing of us
  }
  EXPECT_THAT(MessageOf<DatabaseCorrupt>([&] { (void)Open(); }), HasSubstr("newer"));
}

/// As a later version leaves it: more tables and columns, and whether this version can go on.
void MakeNewer(const fs::path& database, const std::string& usable_from) {
  Database direct(database, Database::Access::kReadWrite);
  direct.Execute(
      "ALTER TABLE patients ADD COLUMN colour TEXT NOT NULL DEFAULT 'none'; ALTER TABLE scans ADD "
      "COLUMN mood TEXT; CREATE TABLE rooms (id INTEGER PRIMARY KEY, name TEXT NOT NULL) STRICT;");
  direct.Execute(fmt::format("PRAGMA user_version = {}", kSchemaVersion + 1));
  direct.Run("UPDATE settings SET value = ? WHERE name = ?", usable_from, kUsableFromName);
}

TEST_F(StoreTest, AfterARollBackTheOldVersionWorksWithTheNewerDatabase) {
  const std::string patient = Open()->patients.Add(kAnna, "P-1", "thorax");
  MakeNewer(database(), std::to_string(kSchemaVersion));
  std::string scan;
  {
    const auto store = Open();
    EXPECT_EQ(store->patients.Find(patient)->site, "thorax");
    scan = Scan(*store, patient, ApprovedReference(*store, patient), kResult);
    (void)store->patients.Add(kAnna, "P-2", "");
    EXPECT_FALSE(store->audit.FirstBroken());
  }
  const auto again = Open();
  EXPECT_THAT(again->patients.List(), SizeIs(2));
  EXPECT_TRUE(again->scans.Find(scan));
  Database direct(database(), Database::Access::kReadOnly);
  EXPECT_EQ(direct.FirstInteger("PRAGMA user_version"),
            kSchemaVersion + 1);  // the newer version finds it migrated
}

TEST_F(StoreTest, ANewerDatabaseThatThisVersionCannotUseIsRefused) {
  (void)Open();
  for (const std::string& usable_from :
       {std::to_string(kSchemaVersion + 1), std::string("99"), std::string(), std::string("x"),
        std::string("8x"), std::string("0"), std::string("-1")}) {
    RemoveDatabase();
    (void)Open();
    MakeNewer(database(), usable_from);
    EXPECT_THAT(MessageOf<DatabaseCorrupt>([&] { (void)Open(); }), HasSubstr("newer"))
        << usable_from;
  }
}

TEST_F(StoreTest, AStoreOfTheFirstVersionKeepsWhatItHas) {
  std::string patient, accepted, other;
  {
    const auto store = Open();
    patient = store->patients.Add(kAnna, "P-1", "thorax");
    const std::string reference = ApprovedReference(*store, patient);
    other = Scan(*store, patient, reference, kResult);
    accepted = Scan(*store, patient, reference, kResult);
    store->scans.Accept(kAnna, accepted, "the swelling is known");
  }
  const AuditEntry logged = Open()->audit.Find({0, 1, "scan.accept"}).at(0);
  testing::MakeSchema3(database());
  const auto store = Open();
  ASSERT_THAT(store->patients.List(), SizeIs(1));
  EXPECT_EQ(store->patients.Find(patient)->site, "thorax");
  EXPECT_EQ(store->patients.Find(patient)->note, "");
  EXPECT_FALSE(store->patients.Find(patient)->archived);
  store->patients.Change(kAnna, patient, {.site = "thorax", .note = "note"});
  EXPECT_EQ(store->patients.Find(patient)->note, "note");
  EXPECT_EQ(store->scans.Find(accepted)->accepted_at, logged.time) << "taken from the log";
  EXPECT_FALSE(store->scans.Find(other)->accepted_at);
  const MarkerCheck failed{.status = MarkerCheckStatus::kFailed,
                           .items = {},
                           .reasons = {Message::Verbatim("no marker was seen")}};
  EXPECT_EQ(store->checks.Add(kAnna, "S1", {.check = failed}), "1");
}

TEST_F(StoreTest, WhatVersion020StoredIsReadVerbatim) {
  std::string failed, compared, damaged;
  {
    const auto store = Open();
    const std::string patient = store->patients.Add(kAnna, "P-1", "thorax");
    failed = store->scans.Begin({.patient_id = patient, .reference_id = "", .sensor_serial = "S1"});
    store->scans.Finish(failed, {.failure = Message::Verbatim("no marker was seen")});
    compared = Scan(*store, patient, "", kResult);
    damaged = Scan(*store, patient);
    store->audit.Log(kAnna, "note", "1", "text of then");
    fs::remove(store->folders.Scan(damaged) / "scene" / "scene.json");
  }
  EXPECT_THAT(Open()->scans.Find(damaged)->failure.English(), HasSubstr("scene.json is missing"));
  testing::MakeSchema9(database());
  const auto store = Open();
  EXPECT_EQ(store->scans.Find(failed)->failure, Message::Verbatim("no marker was seen"));
  EXPECT_EQ(store->scans.Find(compared)->result->reasons,
            std::vector{Message::Verbatim("vertical is off")});
  EXPECT_EQ(store->scans.Find(damaged)->failure,
            say::store::FilesUnusable(Message::Verbatim("scene/scene.json is missing")));
  EXPECT_EQ(store->audit.Find({0, 1, "note"}).at(0).detail, Message::Verbatim("text of then"));
  EXPECT_FALSE(store->audit.FirstBroken());
  const std::string scan =
      store->scans.Begin({.patient_id = "", .reference_id = "", .sensor_serial = ""});
  store->scans.Finish(scan, {.failure = say::store::RoomMisfit(3.25)});
  EXPECT_EQ(store->scans.Find(scan)->failure, say::store::RoomMisfit(3.25));
}

TEST_F(StoreTest, AVersionThatKnowsSentencesOnlyLeavesNoMessageOfAnotherOne) {
  std::string scan;
  {
    const auto store = Open();
    const std::string patient = store->patients.Add(kAnna, "P-1", "thorax");
    scan = Scan(*store, patient);
    (void)Scan(*store, patient);
    StoreChange change(store->database());
    SetUnavailable(*change, 1, "", say::store::NoFiles());
    change.Commit();
    EXPECT_EQ(store->scans.Find(scan)->failure, say::store::FilesUnusable(say::store::NoFiles()));
    change->Run("UPDATE scans SET unavailable = 'it is on fire' WHERE id = 1");  // as 0.2.0 does
  }
  Database direct(database(), Database::Access::kReadOnly);
  EXPECT_EQ(direct.FirstText("SELECT unavailable_message FROM scans WHERE id = 1"), "");
}

TEST_F(StoreTest, ADatabaseOfASchemaThatWasNeverReleasedIsRefused) {
  for (const int version : {1, 2, 4, 5, 6, 7, 8}) {
    RemoveDatabase();
    (void)Open();
    Database(database(), Database::Access::kReadWrite)
        .Execute(fmt::format("PRAGMA user_version = {}", version));
    EXPECT_THAT(MessageOf<DatabaseCorrupt>([&] { (void)Open(); }),
                HasSubstr(fmt::format("the database has version {}, which no release", version)));
  }
}

}  // namespace
}  // namespace plumb
