// SPDX-License-Identifier: Apache-2.0
#include "daemon/unit/unit_recovery.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "daemon/archive/backup.hpp"
#include "daemon/plumbd/plumbd.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/skip.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/archive/age_keys.hpp"
#include "tests/unit/archive/old_cipher.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::kAnna;
using testing::MessageOf;

class UnitRecoveryTest : public ::testing::Test {
 protected:
  UnitRecoveryTest() {
    fs::create_directories(stick());
    Store store(state());
    const std::string patient = store.patients.Add(kAnna, "P", "");
    for (int i = 0; i < 2; ++i) (void)testing::StoreScan(store, patient);
  }
  [[nodiscard]] fs::path stick() const { return folder_ / "stick"; }
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  [[nodiscard]] UnitRecovery Read(const std::string& text) const {
    WriteWholeFile(stick() / "plumb-recovery.toml", std::string_view(text));
    return ReadUnitRecovery(stick() / "plumb-recovery.toml");
  }
  [[nodiscard]] std::string WhyNot(const std::string& text) const {
    return MessageOf<DataError>([&] { (void)Read(text); });
  }
  /// @param name  On the stick; everybody may read it there.
  fs::path KeyFile(const std::string& name, const std::string& line) const {
    WriteWholeFile(stick() / name, std::string_view(line));
    fs::permissions(stick() / name, fs::perms(0644));
    return stick() / name;
  }

  testing::TempFolder folder_;
};

TEST_F(UnitRecoveryTest, PathsAreOfTheFilesFolder) {
  const UnitRecovery lost = Read("[recovery]\nlost_scans = 12\n");
  EXPECT_EQ(lost.lost_scans, 12);
  EXPECT_EQ(lost.backup, "");
  const UnitRecovery given = Read("[recovery]\nrestore = \"plumb-3\"\nkey_file = \"k\"\n");
  EXPECT_EQ(given.lost_scans, std::nullopt);
  EXPECT_EQ(given.backup, stick() / "plumb-3");
  EXPECT_EQ(given.key_file, stick() / "k");
  EXPECT_EQ(Read("[recovery]\nrestore = \"/var/lib/plumb-backup/plumb-3\"\n").backup,
            "/var/lib/plumb-backup/plumb-3");
}

TEST_F(UnitRecoveryTest, AMistakeIsReportedWithItsLine) {
  EXPECT_THAT(WhyNot(""), HasSubstr("either lost_scans or restore"));
  EXPECT_THAT(WhyNot("[recovery]\nlost_scans = 2\nrestore = \"x\"\n"), HasSubstr("either"));
  EXPECT_THAT(WhyNot("[recovery]\nlost_scans = 1\n"), HasSubstr("toml:2: recovery.lost_scans"));
  EXPECT_THAT(WhyNot("[recovery]\nlost_scans = true\n"), HasSubstr("toml:2"));
  EXPECT_THAT(WhyNot("[recovery]\nlost_scans = 2\nkey_file = \"x\"\n"),
              HasSubstr("belong to restore"));
  EXPECT_THAT(WhyNot("[recovery]\nrestore = \"\"\n"), HasSubstr("toml:2"));
  EXPECT_THAT(WhyNot("[recovery]\nwipe = true\n"), HasSubstr("wipe"));
  EXPECT_THAT(WhyNot("[unit]\nserial = \"1\"\n"), HasSubstr("unknown table or key 'unit'"));
}

TEST_F(UnitRecoveryTest, ABackupIsRestoredAndTheReplacedIsKept) {
  (void)BackUpStopped(state(), stick() / "backup.tar");
  WriteWholeFile(state() / "plumb.db", std::string_view("no database"));
  EXPECT_THAT(RecoverUnit(Read("[recovery]\nrestore = \"backup.tar\"\n"), state(), {}).English(),
              HasSubstr("2 scans, 15 files; the previous data is in " +
                        (state() / "before-restore-1").string()));
  EXPECT_EQ(testing::FilesBelow(state() / "before-restore-1").at("plumb.db"), "no database");
  Store store(state());
  EXPECT_EQ(store.patients.List().size(), 1U);
  EXPECT_EQ(store.audit.Find({0, 10, "backup.restore"}).size(), 1U);
}

TEST_F(UnitRecoveryTest, AUnitThatWorksIsLeftAlone) {
  (void)BackUpStopped(state(), stick() / "backup");
  const Store store(state());
  for (const char* text : {"[recovery]\nrestore = \"backup\"\n", "[recovery]\nlost_scans = 2\n"}) {
    EXPECT_THAT(MessageOf<DataError>([&] {
                  (void)RecoverUnit(Read(text), state(), {},
                                    {.longest = std::chrono::milliseconds(0), .sleep = {}});
                }),
                HasSubstr("nothing was recovered or changed"));
  }
  EXPECT_FALSE(fs::exists(state() / "before-restore-1"));
  EXPECT_FALSE(fs::exists(state() / "scans-are-lost"));
}

// A plumbd in safe mode has the lock whenever it tries to open its store.
TEST_F(UnitRecoveryTest, AFolderThatIsHeldForAMomentIsWaitedFor) {
  (void)BackUpStopped(state(), stick() / "backup");
  for (const char* text : {"[recovery]\nrestore = \"backup\"\n", "[recovery]\nlost_scans = 2\n"}) {
    auto held = std::make_unique<FolderLock>();
    held->Take(state());
    int num_pauses = 0;
    const auto pause = [&](std::chrono::milliseconds) {
      if (++num_pauses == 3) held.reset();
    };
    EXPECT_NE(
        RecoverUnit(Read(text), state(), {}, {.longest = std::chrono::minutes(1), .sleep = pause})
            .English(),
        "");
    EXPECT_EQ(num_pauses, 3);
  }
  EXPECT_TRUE(fs::exists(state() / "before-restore-1"));
  EXPECT_TRUE(fs::exists(state() / "scans-are-lost"));
}

// Plumbd's account may have put links anywhere in its folder, and the stick is a stranger's.
TEST_F(UnitRecoveryTest, RootTakesTheRightsOfTheFoldersOwner) {
  if (::geteuid() != 0) PLUMB_SKIP("needs root, which takes the rights of another account");
  constexpr uid_t kOwner = 12345;
  (void)BackUpStopped(state(), stick() / "backup.tar");
  const UnitRecovery given = Read("[recovery]\nrestore = \"backup.tar\"\n");
  fs::permissions(stick() / "backup.tar", fs::perms(0644));
  fs::permissions(folder_.path(), fs::perms(0711));
  ASSERT_EQ(::chown(state().c_str(), kOwner, kOwner), 0);
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(state()))
    ASSERT_EQ(::lchown(entry.path().c_str(), kOwner, kOwner), 0);
  fs::create_directory(folder_ / "of-root");
  const auto recover = [&] {
    std::string done = RecoverUnit(given, state(), {}).English();
    const bool is_owner = ::getuid() == kOwner && ::getegid() == kOwner && ::setuid(0) != 0;
    std::error_code error;
    fs::create_directory(folder_ / "of-root" / "x", error);
    std::_Exit(is_owner && error && done.find("2 scans") != std::string::npos ? 0 : 1);
  };
  EXPECT_EXIT(recover(), ::testing::ExitedWithCode(0), "");
  struct stat restored {};
  ASSERT_EQ(::stat((state() / "plumb.db").c_str(), &restored), 0);
  EXPECT_EQ(restored.st_uid, kOwner);
}

// Whoever has the stick need not have the key.
TEST_F(UnitRecoveryTest, WithAConfiguredKeyAForeignBackupIsRefused) {
  const fs::path key = KeyFile("key", "correct horse battery staple\n");
  const fs::path configured = folder_ / "backup.key";
  fs::copy(key, configured);
  fs::permissions(configured, fs::perms(0600));
  const UnitBackupKeys keys{.key_file = configured};
  (void)BackUpStopped(state(), stick() / "plain");
  (void)BackUpStopped(state(), stick() / "sealed");
  testing::SealAsOld(stick() / "sealed", "backup.json", "correct horse battery staple");
  EXPECT_THAT(MessageOf<DataError>([&] {
                (void)RecoverUnit(Read("[recovery]\nrestore = \"plain\"\n"), state(), keys);
              }),
              HasSubstr("not encrypted"));
  const std::string with_key = "[recovery]\nrestore = \"sealed\"\nkey_file = \"key\"\n";
  EXPECT_THAT(MessageOf<DataError>([&] { (void)RecoverUnit(Read(with_key), state(), keys); }),
              HasSubstr("leave recovery.key_file out"));
  EXPECT_FALSE(fs::exists(state() / "before-restore-1"));
  EXPECT_THAT(RecoverUnit(Read("[recovery]\nrestore = \"sealed\"\n"), state(), keys).English(),
              HasSubstr("2 scans"));
  EXPECT_THAT(RecoverUnit(Read(with_key), state(), {}).English(), HasSubstr("before-restore-2"))
      << "a unit without its configuration takes the key from the stick";
}

// The public keys are no secret: whoever has them can make a backup, but not open one.
TEST_F(UnitRecoveryTest, WithConfiguredRecipientsAnIdentityOfOneIsNeeded) {
  const UnitBackupKeys keys{.recipients = AgeRecipients({testing::kRecipient})};
  (void)KeyFile("id", testing::kIdentity);
  (void)KeyFile("other", testing::kOtherIdentity);
  (void)BackUpStopped(state(), stick() / "plain");
  (void)BackUpStopped(state(), stick() / "plumb", {},
                      AgeRecipients({testing::kRecipient, testing::kOtherRecipient}));
  const auto why = [&](const std::string& text, const UnitBackupKeys& configured) {
    return MessageOf<DataError>(
        [&] { (void)RecoverUnit(Read("[recovery]\n" + text), state(), configured); });
  };
  EXPECT_THAT(why("restore = \"plain\"\n", keys), HasSubstr("recovery.identity"));
  EXPECT_THAT(why("restore = \"plain\"\nidentity = \"id\"\n", keys), HasSubstr("not encrypted"));
  EXPECT_THAT(why("restore = \"plumb.tar.age\"\n", keys), HasSubstr("recovery.identity"));
  EXPECT_THAT(why("restore = \"plumb.tar.age\"\nidentity = \"other\"\n", keys),
              HasSubstr("none of the unit's backup_recipients"))
      << "though it opens the backup";
  EXPECT_THAT(why("restore = \"plumb.tar.age\"\nidentity = \"other\"\n",
                  {.key_file = folder_ / "backup.key"}),
              HasSubstr("leave recovery.identity out"));
  EXPECT_FALSE(fs::exists(state() / "before-restore-1"));
  const std::string right = "[recovery]\nrestore = \"plumb.tar.age\"\nidentity = \"id\"\n";
  EXPECT_THAT(RecoverUnit(Read(right), state(), keys).English(), HasSubstr("before-restore-1"));
  EXPECT_THAT(RecoverUnit(Read(right), state(), {}).English(), HasSubstr("before-restore-2"));
}

TEST_F(UnitRecoveryTest, ABadConfigurationIsNoneUnlessItNamesAKeyForBackups) {
  (void)BackUpStopped(state(), stick() / "backup");
  (void)Read("[recovery]\nrestore = \"backup\"\n");
  const fs::path config = folder_ / "plumb.toml";
  const auto recover = [&](const std::string& text) {
    WriteWholeFile(config, std::string_view(text));
    std::vector<std::string> words = {"plumbd",
                                      "--config",
                                      config,
                                      "--state",
                                      state(),
                                      "--recover",
                                      stick() / "plumb-recovery.toml"};
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    ::testing::internal::CaptureStdout();
    const int code = RunPlumbd(static_cast<int>(arguments.size()), arguments.data());
    return std::to_string(code) + ' ' + ::testing::internal::GetCapturedStdout();
  };
  for (const char* text : {"[storage]\nbackup_hours = 0\nbackup_key_file = \"/etc/key\"\n",
                           "storage = {x = \"#\", backup_key_file = \"/etc/key\"",
                           "[stor\nbackup_recipients = [\"age1\"]\n",
                           "[storage\n"
                           "  backup_key_file = \"/etc/key\"\n"}) {
    EXPECT_EQ(recover(text), "3 ") << text;
  }
  EXPECT_FALSE(fs::exists(state() / "before-restore-1"));
  int num_restored = 0;
  for (const char* text : {"[storage]\nbackup_hours = 0\n", "[stor",
                           "[storage]\n # backup_key_file = \"/etc/key\"\nx = 1\n"}) {
    EXPECT_THAT(recover(text),
                AllOf(HasSubstr("0 the configuration cannot be used"), HasSubstr(config.string()),
                      HasSubstr("What is recovered is " + state().string()),
                      HasSubstr(fmt::format("before-restore-{}", ++num_restored))))
        << text;
  }
  (void)Read("[recovery]\nlost_scans = 2\n");
  EXPECT_THAT(recover("[storage]\nx = 1\nbackup_key_file = \"/etc/key\"\n"),
              HasSubstr("2 missing scans are confirmed"))
      << "which needs no key";
}

}  // namespace
}  // namespace plumb
