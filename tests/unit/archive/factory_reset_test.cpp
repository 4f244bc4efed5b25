// SPDX-License-Identifier: Apache-2.0
#include "daemon/archive/factory_reset.hpp"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/message_of.hpp"
#include "tests/unit/records/store_fixture.hpp"
#include "words/upkeep.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::kAnna;
using testing::MessageOf;
using ::testing::SizeIs;

class FactoryResetTest : public testing::StoreTest {
 protected:
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  [[nodiscard]] bool IsThere(const char* name) const {
    return fs::exists(fs::symlink_status(state() / name));
  }
  void Put(const fs::path& name) const {
    fs::create_directories((state() / name).parent_path());
    WriteWholeFile(state() / name, std::string_view("x"));
  }
  /// A state folder that has been used. @returns its patient's id.
  std::string Use() {
    const auto store = Open();
    store->users.Add(kAnna, {.name = "anna",
                             .role = Role::kEngineer,
                             .password_hash = "h",
                             .disabled = false,
                             .created_at = {}});
    (void)store->displays.Add(
        kAnna,
        {.id = {}, .name = "wall", .token_hash = "token", .paired_at = {}, .paired_by = "anna"});
    Settings settings;
    settings.idle_logout_min = 99;
    store->settings.Change(kAnna, settings);
    const std::string patient = store->patients.Add(kAnna, "P-1", "thorax");
    scan_ = Scan(*store, patient);
    for (const char* name :
         {"page-key.pem", "page-authority.pem", "device.key", "provisioned-display",
          "updates/v2.raucb", "profiles/S1.json", "calibration/S1.yaml"})
      Put(name);
    return patient;
  }
  std::string scan_;
};

TEST_F(FactoryResetTest, WithoutARequestNothingHappens) {
  (void)Use();
  EXPECT_FALSE(CarryOutFactoryReset(state()));
  EXPECT_THAT(Open()->users.List(), SizeIs(1));
}

TEST_F(FactoryResetTest, KeepingTheRecordsRemovesPeopleSettingsAndKeys) {
  const std::string patient = Use();
  RequestFactoryReset(state(), FactoryReset::kKeepRecords, kAnna);
  ASSERT_TRUE(CarryOutFactoryReset(state()));
  const auto store = Open();
  EXPECT_THAT(store->users.List(), SizeIs(0));
  EXPECT_THAT(store->displays.List(), SizeIs(0));
  EXPECT_EQ(store->settings.Get().idle_logout_min, Settings{}.idle_logout_min);
  EXPECT_TRUE(store->patients.Find(patient));
  EXPECT_TRUE(fs::exists(store->folders.Scan(scan_) / "scene" / "scene.json"));
  EXPECT_EQ(store->audit.Find({0, 1, "system."}).at(0).user, kAnna.user);
  EXPECT_GT(store->audit.Find({0, 100, ""}).size(), 4U) << "the log goes on";
  EXPECT_FALSE(store->audit.FirstBroken());
  for (const char* gone : {"page-key.pem", "page-authority.pem", "device.key",
                           "provisioned-display", "updates", kFactoryResetFile})
    EXPECT_FALSE(IsThere(gone)) << gone;
  for (const char* kept : {"profiles/S1.json", "calibration/S1.yaml"})
    EXPECT_TRUE(IsThere(kept)) << kept;
}

TEST_F(FactoryResetTest, WipingLeavesAnEmptyStoreThatSaysWhoAskedForIt) {
  (void)Use();
  Put("set-aside/000009/scene.json");
  fs::create_symlink("/nowhere", state() / "link");
  RequestFactoryReset(state(), FactoryReset::kWipe, kAnna);
  ASSERT_TRUE(CarryOutFactoryReset(state()));
  const auto store = Open();
  EXPECT_THAT(store->patients.List(), SizeIs(0));
  EXPECT_THAT(store->users.List(), SizeIs(0));
  const auto log = store->audit.Find({0, 100, ""});
  ASSERT_THAT(log, SizeIs(1));
  EXPECT_EQ(log[0].action, "system.factory_reset");
  EXPECT_EQ(log[0].user, kAnna.user);
  EXPECT_TRUE(fs::is_empty(state() / "scans"));
  for (const char* gone : {"page-key.pem", "page-authority.pem", "provisioned-display", "profiles",
                           "calibration", "set-aside", "link", "updates", kFactoryResetFile})
    EXPECT_FALSE(IsThere(gone)) << gone;
}

TEST_F(FactoryResetTest, AWipeFollowsTheLinkToTheDiskOfTheScans) {
  (void)Use();
  fs::rename(state() / "scans", folder_ / "disk");
  fs::create_directory_symlink(folder_ / "disk", state() / "scans");
  fs::create_directories(folder_ / "disk" / "lost+found");
  ASSERT_TRUE(fs::exists(state() / "scans" / scan_ / "scene" / "scene.json"));
  RequestFactoryReset(state(), FactoryReset::kWipe, kAnna);
  fs::rename(folder_ / "disk", folder_ / "not mounted");
  EXPECT_THROW((void)CarryOutFactoryReset(state()), DiskRefused);
  EXPECT_TRUE(fs::exists(database())) << "not half of it";
  fs::rename(folder_ / "not mounted", folder_ / "disk");
  ASSERT_TRUE(CarryOutFactoryReset(state()));
  EXPECT_TRUE(fs::exists(folder_ / "disk" / "lost+found"));
  EXPECT_FALSE(fs::exists(folder_ / "disk" / scan_)) << "it is said that everything was removed";
  EXPECT_THAT(Open()->patients.List(), SizeIs(0));
}

/// systemd/factory-reset, as root, could not empty a folder.
TEST_F(FactoryResetTest, AWipeIsNotDoneWhileSomethingIsLeftOutside) {
  (void)Use();
  RequestFactoryReset(state(), FactoryReset::kWipe, kAnna);
  WriteWholeFile(state() / kFactoryResetLeft, std::string_view("/data/dicom\nwrite-protected\n"));
  for (int start = 0; start < 2; ++start) {
    const std::string why = MessageOf<DiskRefused>([&] { (void)CarryOutFactoryReset(state()); });
    EXPECT_THAT(why, HasSubstr("cannot remove /data/dicom: write-protected"));
    EXPECT_FALSE(fs::exists(database())) << "what names patients is gone at once";
    EXPECT_FALSE(IsThere("scans"));
    EXPECT_TRUE(IsThere(kFactoryResetFile)) << "the next start goes on";
  }
  fs::remove(state() / kFactoryResetLeft);
  ASSERT_TRUE(CarryOutFactoryReset(state()));
  EXPECT_THAT(Open()->audit.Find({0, 100, ""}), SizeIs(1));
}

TEST_F(FactoryResetTest, WhatIsLeftOutsideConcernsAWipeOnly) {
  (void)Use();
  RequestFactoryReset(state(), FactoryReset::kKeepRecords, kAnna);
  WriteWholeFile(state() / kFactoryResetLeft, std::string_view("/data/dicom\n\n"));
  EXPECT_TRUE(CarryOutFactoryReset(state()));
}

/// Power is lost at any point of it: the request is still there, and the folder half empty.
TEST_F(FactoryResetTest, AnInterruptedWipeGoesOn) {
  (void)Use();
  RequestFactoryReset(state(), FactoryReset::kWipe, kAnna);
  fs::remove_all(state() / "scans");
  fs::remove(state() / "plumb.db");
  ASSERT_TRUE(CarryOutFactoryReset(state()));
  EXPECT_THAT(Open()->patients.List(), SizeIs(0));
  EXPECT_FALSE(IsThere("calibration"));
  EXPECT_FALSE(CarryOutFactoryReset(state())) << "once";
}

TEST_F(FactoryResetTest, AWipeHelpsWithADamagedDatabaseToo) {
  (void)Use();
  WriteWholeFile(database(), std::string(20000, 'x'));
  RequestFactoryReset(state(), FactoryReset::kKeepRecords, kAnna);
  EXPECT_THROW((void)CarryOutFactoryReset(state()), DatabaseCorrupt);
  EXPECT_TRUE(IsThere("page-key.pem")) << "nothing was reset";
  EXPECT_TRUE(IsThere(kFactoryResetFile));
  RequestFactoryReset(state(), FactoryReset::kWipe, kAnna);
  ASSERT_TRUE(CarryOutFactoryReset(state()));
  EXPECT_THAT(Open()->patients.List(), SizeIs(0));
}

TEST_F(FactoryResetTest, ARequestCanBeTakenBack) {
  (void)Use();
  RequestFactoryReset(state(), FactoryReset::kWipe, kAnna);
  const Message why = Message::Verbatim("no restart");
  EXPECT_EQ(CancelFactoryReset(state(), why), why);
  EXPECT_EQ(CancelFactoryReset(state(), why), why) << "there is none any more";
  EXPECT_FALSE(CarryOutFactoryReset(state()));
  EXPECT_THAT(Open()->patients.List(), SizeIs(1));
}

TEST_F(FactoryResetTest, ARequestThatCannotBeTakenBackIsSaid) {
  fs::create_directories(state() / kFactoryResetFile);
  const Message why = Message::Verbatim("no restart");
  const Message answer = CancelFactoryReset(state(), why);
  EXPECT_TRUE(answer.Is(say::upkeep::kResetMayHappen));
  EXPECT_THAT(answer.English(), HasSubstr("no restart; the requested factory reset may still"));
}

TEST_F(FactoryResetTest, ARequestThatCannotBeReadResetsNothing) {
  (void)Use();
  for (const char* text :
       {"", "{", "[]", "{}", R"({"kind":"wipe"})", R"({"kind":"all","user":"a","address":""})",
        R"({"kind":3,"user":"a","address":""})"}) {
    WriteWholeFile(state() / kFactoryResetFile, std::string_view(text));
    EXPECT_THAT(MessageOf<DataError>([&] { (void)CarryOutFactoryReset(state()); }),
                HasSubstr("Nothing was reset"))
        << text;
    EXPECT_TRUE(IsThere(kFactoryResetFile));
  }
  EXPECT_THAT(Open()->patients.List(), SizeIs(1));
}

TEST_F(FactoryResetTest, WhatAnotherPlumbdUsesIsNotReset) {
  (void)Use();
  const auto other = Open();
  RequestFactoryReset(state(), FactoryReset::kWipe, kAnna);
  EXPECT_THROW((void)CarryOutFactoryReset(state()), DatabaseBusy);
  EXPECT_THAT(other->patients.List(), SizeIs(1));
}

}  // namespace
}  // namespace plumb
