// SPDX-License-Identifier: Apache-2.0
// Rows that another program changed behind plumbd's back, with pages that are as they should be.
#include "daemon/database/row_digests.hpp"

#include <cstdlib>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/database/schema.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/skip.hpp"
#include "tests/unit/records/store_fixture.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::kAnna;
using testing::kBert;
using testing::MessageOf;
using ::testing::SizeIs;

constexpr std::size_t kKeyBytes = 32;

/// What somebody changes, and what has to be named.
struct Edit {
  const char* sql;
  const char* named;
};

constexpr Edit kEdits[] = {
    {"UPDATE users SET role = 'engineer' WHERE name = 'tom'", "account \"tom\""},
    {"UPDATE users SET password_hash = 'mine' WHERE name = 'eva'", "account \"eva\""},
    {"UPDATE users SET disabled = 1 WHERE name = 'eva'", "account \"eva\""},
    {"INSERT INTO users (name, role, password_hash, created_at) VALUES ('eve', 'engineer', 'x', 1)",
     "account \"eve\""},
    {"DELETE FROM users WHERE name = 'tom'", "account \"tom\""},
    {"DELETE FROM second_factors", "account \"eva\""},
    {"UPDATE second_factors SET last_step = 0", "account \"eva\""},
    {"UPDATE pins SET hash = 'mine'", "account \"tom\""},
    {"UPDATE displays SET token_hash = 'mine'", "display \"1\""},
    {"UPDATE settings SET value = replace(value, 'HFS', 'FFS') WHERE name = 'settings'",
     "setting \"settings\""},
    {"DELETE FROM settings WHERE name = 'settings'", "setting \"settings\""},
    {"DELETE FROM settings WHERE name = 'settings'; DELETE FROM row_digests WHERE id = 'settings'",
     "setting \"settings\""},
    {"UPDATE settings SET value = replace(value, 'Couch 2', 'Couch 3') WHERE name = 'couch'",
     "setting \"couch\""},
    {"UPDATE templates SET shift_mm = 70", "template of plans \"thorax\""},
    {"UPDATE sessions SET reference_id = NULL", "treatment session \"1\""},
    {"DROP TRIGGER refs_immutable; UPDATE refs SET approved_by = 'eve'", "reference \"1\""},
    {"UPDATE refs SET approved_by = 'eve', approved_at = 1 WHERE approved_by = ''",
     "reference \"2\""},
    {"DROP TRIGGER checks_no_update; UPDATE checks SET status = 'passed'", "daily check \"1\""},
    {"INSERT INTO check_baselines (check_id, set_at, set_by) VALUES (1, 1, 'eve')",
     "baseline \"1\""},
    {"INSERT INTO room_calibrations (signed_at, signed_by, digest, json) VALUES (1, 'eve', 'd', "
     "'{}')",
     "calibration of the room \"1\""},
    {"UPDATE row_digests SET digest = replace(digest, 'a', 'b') WHERE id = 'eva'",
     "account \"eva\""},
    {"DELETE FROM row_digests WHERE kind = 'display'", "display \"1\""},
};

class RowDigestsTest : public testing::StoreTest {
 protected:
  /// A store with rows of every kind but a baseline and a room.
  void SetUp() override {
    const auto store = Open();
    for (const auto& [name, role] : {std::pair("eva", Role::kEngineer), {"tom", Role::kTechnician}})
      store->users.Add(kAnna, {.name = name,
                               .role = role,
                               .password_hash = "hash",
                               .disabled = false,
                               .created_at = {}});
    store->users.SetSecondFactor(
        kAnna, "eva", std::nullopt,
        SecondFactor{.secret = "secret", .last_step = 7, .recovery_hashes = {"a", "b"}}, "");
    store->users.SetPin(kAnna, "tom", "pin");
    (void)store->displays.Add(
        kAnna, {.id = {}, .name = "Room", .token_hash = "token", .paired_at = {}, .paired_by = {}});
    store->settings.Change(kAnna, {});
    (void)store->couch.Sign(kAnna, {.name = "Couch 2"});
    store->templates.Set(kAnna, {.site = "thorax",
                                 .width_mm = 300,
                                 .height_mm = 200,
                                 .tolerance = {},
                                 .changed_by = {},
                                 .posture = {},
                                 .hint = {}});
    const std::string patient = store->patients.Add(kAnna, "P-1", "thorax");
    (void)ApprovedReference(*store, patient);
    (void)store->references.Add(kAnna, Scan(*store, patient), "draft", {});
    (void)store->treatments.Open(kAnna, patient, ScanPurpose::kFraction);
    (void)store->checks.Add(kAnna, "S1", {});
  }
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  /// Its pages get the checksums that they should have.
  void ChangeBehind(const std::string& sql) const {
    Database(database(), Database::Access::kReadWrite).Execute(sql);
  }
  [[nodiscard]] std::string WhyNotOpened() const {
    return MessageOf<DatabaseCorrupt>([&] { (void)Open(); });
  }
  void Keep() const { fs::copy(state(), folder_ / "kept", fs::copy_options::recursive); }
  void PutBack() const {
    fs::remove_all(state());
    fs::copy(folder_ / "kept", state(), fs::copy_options::recursive);
  }
};

TEST_F(RowDigestsTest, EveryRowThatAnotherProgramChangedIsRefusedByItsName) {
  Keep();
  for (const Edit& edit : kEdits) {
    ChangeBehind(edit.sql);
    EXPECT_THAT(WhyNotOpened(), ::testing::AllOf(HasSubstr(edit.named), HasSubstr("plumb restore"),
                                                 HasSubstr("rows-are-right")))
        << edit.sql;
    PutBack();
  }
  EXPECT_NO_THROW((void)Open());
}

TEST_F(RowDigestsTest, ARowThatIsChangedMeanwhileIsRefusedWhenItIsRead) {
  const auto store = Open();
  ChangeBehind(
      "UPDATE users SET role = 'engineer' WHERE name = 'tom'; UPDATE settings SET value = "
      "value || ' '; UPDATE displays SET name = 'x'; UPDATE templates SET shift_mm = "
      "70; UPDATE sessions SET purpose = 'reference'; DROP TRIGGER refs_immutable; UPDATE refs SET "
      "approved_by = 'eve'");
  const auto refuses = [](const auto& read) {
    return MessageOf<DatabaseCorrupt>([&] { (void)read(); });
  };
  EXPECT_THAT(refuses([&] { return store->users.Find("tom"); }), HasSubstr("account \"tom\""));
  EXPECT_THAT(refuses([&] { return store->users.List(); }), HasSubstr("account \"tom\""));
  EXPECT_THAT(refuses([&] { return store->users.PinOf("tom"); }), HasSubstr("account \"tom\""));
  EXPECT_TRUE(store->users.Find("eva")) << "whose row is right";
  EXPECT_THAT(refuses([&] { return store->settings.Get(); }), HasSubstr("setting \"settings\""));
  EXPECT_THAT(refuses([&] { return store->couch.Get(); }), HasSubstr("setting \"couch\""));
  EXPECT_THAT(refuses([&] { return store->displays.List(); }), HasSubstr("display \"1\""));
  EXPECT_THAT(refuses([&] { return store->templates.List(); }), HasSubstr("thorax"));
  EXPECT_THAT(refuses([&] { return store->treatments.Opened(); }), HasSubstr("session \"1\""));
  EXPECT_THAT(refuses([&] { return store->treatments.PatientOf("1"); }),
              HasSubstr("session \"1\""));
  EXPECT_THAT(refuses([&] { return store->references.OfSession("1"); }),
              HasSubstr("session \"1\""));
  EXPECT_THAT(refuses([&] { return store->references.Approved("1"); }), HasSubstr("reference"));
  EXPECT_THAT(refuses([&] { return store->references.Find("1"); }), HasSubstr("reference \"1\""));
  Database disk(database(), Database::Access::kFromDisk);
  UseRowKey(disk, state());
  EXPECT_THAT(refuses([&] {
                RequireAllRows(disk);
                return 0;
              }),
              HasSubstr("account \"tom\""))
      << "as once a day";
}

TEST_F(RowDigestsTest, AProgramThatKnowsNoChecksumsIsNoticedByThePages) {
  if (std::system("sqlite3 --version >/dev/null 2>&1") != 0) PLUMB_SKIP("sqlite3 is not installed");
  ASSERT_EQ(std::system(fmt::format("sqlite3 '{}' \"UPDATE users SET role = 'engineer'\"",
                                    database().string())
                            .c_str()),
            0);
  EXPECT_THAT(WhyNotOpened(), HasSubstr("plumb.db"));
}

TEST_F(RowDigestsTest, ADatabaseWithoutDigestsGetsThemOnce) {
  for (const bool is_older : {true, false}) {
    if (is_older) {
      testing::MakeSchema9(database());
    } else {  // as before the digests
      ChangeBehind(
          "DROP TABLE row_digests; DROP TRIGGER audit_no_delete; DELETE FROM audit WHERE action = "
          "'rows.sign'");
    }
    fs::remove(state() / kRowKeyFile);
    {
      const auto store = Open();
      EXPECT_EQ(store->users.Find("tom")->role, Role::kTechnician);
      EXPECT_EQ(store->audit.Find({0, 10, "rows.sign"}).front().detail.English(),
                "they had none before");
    }
    EXPECT_EQ(fs::status(state() / kRowKeyFile).permissions(),
              fs::perms::owner_read | fs::perms::owner_write);
    Keep();
    ChangeBehind("UPDATE users SET role = 'engineer' WHERE name = 'tom'");
    EXPECT_THAT(WhyNotOpened(), HasSubstr("account \"tom\"")) << is_older;
    PutBack();
    fs::remove_all(folder_ / "kept");
  }
}

TEST_F(RowDigestsTest, WithoutKeyOrDigestsNothingIsTrustedUntilAPersonConfirms) {
  Keep();
  const std::vector<void (*)(const fs::path&)> losses = {
      [](const fs::path& state) { fs::remove(state / kRowKeyFile); },
      [](const fs::path& state) { fs::resize_file(state / kRowKeyFile, kKeyBytes / 2); },
      [](const fs::path& state) {
        WriteWholeFile(state / kRowKeyFile, std::string(kKeyBytes, 'k'));
      },
      [](const fs::path& state) {
        Database(state / kDatabaseFile, Database::Access::kReadWrite)
            .Execute("DROP TABLE row_digests");
      },
  };
  for (std::size_t i = 0; i < losses.size(); ++i) {
    losses[i](state());
    EXPECT_THAT(WhyNotOpened(), HasSubstr("rows-are-right")) << i;
    EXPECT_NE(WhyNotOpened(), "") << "it stays refused";
    WriteWholeFile(state() / kRowsRightFile, std::string_view());
    EXPECT_THAT(Open()->users.List(), SizeIs(2)) << i;
    EXPECT_FALSE(fs::exists(state() / kRowsRightFile)) << "it counts once";
    EXPECT_EQ(Open()->audit.Find({0, 10, "rows.sign"}).front().detail.English(),
              "a person confirmed that they are right");
    PutBack();
  }
}

TEST_F(RowDigestsTest, AnInterruptedStartGoesOn) {
  const fs::path key = state() / kRowKeyFile, new_key = state() / ".rows.key";
  fs::rename(key, new_key);  // the digests were stored, and the key had not got its name
  EXPECT_NO_THROW((void)Open());
  EXPECT_TRUE(fs::exists(key));
  ChangeBehind("DROP TABLE row_digests");
  fs::rename(key, new_key);  // before the digests were stored
  EXPECT_THAT(Open()->users.List(), SizeIs(2));
  EXPECT_FALSE(fs::exists(new_key));
}

TEST_F(RowDigestsTest, ADatabaseOfAnotherUnitNeedsARestore) {
  { const Store other(folder_ / "other"); }
  for (const char* name : {"plumb.db", "plumb.db-mark", "plumb.db-seals"})
    fs::copy_file(state() / name, folder_ / "other" / name, fs::copy_options::overwrite_existing);
  for (const char* name : {"scans", "last-scan"}) fs::remove_all(folder_ / "other" / name);
  fs::copy(state() / "scans", folder_ / "other" / "scans", fs::copy_options::recursive);
  EXPECT_THAT(MessageOf<DatabaseCorrupt>([&] { const Store other(folder_ / "other"); }),
              HasSubstr("of another unit"));
  WriteWholeFile(folder_ / "other" / "restored.json", std::string_view("{}"));
  Store restored(folder_ / "other");
  EXPECT_EQ(restored.audit.Find({0, 10, "rows.sign"}).front().detail.English(),
            "they are of a backup");
}

}  // namespace
}  // namespace plumb
