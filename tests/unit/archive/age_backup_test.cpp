// SPDX-License-Identifier: Apache-2.0
// Backups that are encrypted for recipients: any `age` and any `tar` open them.
#include <poll.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <stop_token>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/archive/age_file.hpp"
#include "daemon/archive/backup.hpp"
#include "daemon/archive/patient_transfer.hpp"
#include "daemon/archive/tar_file.hpp"
#include "tests/support/full_disk.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/process.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/archive/age_keys.hpp"
#include "tests/unit/archive/archive_content.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::ContentOf;
using ::testing::ElementsAre;
using testing::FilesBelow;
using testing::FilesOfState;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kIdentity;
using testing::kOtherIdentity;
using testing::kOtherRecipient;
using testing::kRecipient;
using testing::MessageOf;
using testing::NamesIn;
using testing::StoreScan;

/// Sets PATH for its lifetime.
class PathOf {
 public:
  explicit PathOf(const fs::path& folder) : before_(::getenv("PATH")) {
    ::setenv("PATH", folder.c_str(), 1);
  }
  ~PathOf() { ::setenv("PATH", before_.c_str(), 1); }
  PathOf(const PathOf&) = delete;
  PathOf& operator=(const PathOf&) = delete;

 private:
  std::string before_;
};

class AgeBackupTest : public ::testing::Test {
 protected:
  AgeBackupTest() {
    Store store(state());
    patient_ = store.patients.Add(testing::kAnna, "P", "thorax");
    for (int i = 0; i < 2; ++i) (void)StoreScan(store, patient_);
    fs::create_directories(state() / "calibration");
    // More than one piece of age's, and nothing at all.
    WriteWholeFile(state() / "calibration" / "long.yaml",
                   std::string_view(std::string(700'000, 'p')));
    WriteWholeFile(state() / "calibration" / "empty.yaml", std::string_view());
  }
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  [[nodiscard]] fs::path disk() const { return folder_ / "disk"; }
  [[nodiscard]] fs::path backup() const { return disk() / "plumb.tar.age"; }
  [[nodiscard]] fs::path restored() const { return folder_ / "restored"; }

  BackupReport BackUp(std::vector<std::string> keys = {kRecipient}) const {
    return BackUpStopped(state(), disk() / "plumb", {}, AgeRecipients(std::move(keys)));
  }
  [[nodiscard]] fs::path File(const std::string& name, std::string_view text) const {
    fs::remove(folder_ / name);
    WriteWholeFile(folder_ / name, text);
    return folder_ / name;
  }
  [[nodiscard]] std::vector<std::string> Names() const { return NamesIn(disk()); }
  static auto FilesOf(const fs::path& folder) {
    return FilesOfState(folder, {"SHA256SUMS", "backup.json"});
  }
  [[nodiscard]] std::string Content() const { return ContentOf(backup()); }
  /// Why nothing is restored; nothing is written then, and nothing that was decrypted stays.
  [[nodiscard]] std::string WhyNot(const AgeIdentity* identity) const {
    const std::string why = MessageOf<DataError>(
        [&] { (void)RestoreBackup(backup(), restored(), {}, {.identity = identity}); });
    EXPECT_THAT(why, HasSubstr("nothing was restored"));
    EXPECT_FALSE(fs::exists(restored()));
    for (const auto& entry : fs::directory_iterator(folder_.path()))
      EXPECT_FALSE(entry.path().filename().string().starts_with(".plumb")) << entry;
    return why;
  }

  testing::TempFolder folder_;
  std::string patient_;
  const AgeIdentity identity_{File("id.txt", kIdentity)};
  const AgeIdentity other_{File("other.txt", kOtherIdentity)};
};

TEST_F(AgeBackupTest, AnyAgeAndTarOpenIt) {
  const BackupReport made = BackUp();
  EXPECT_EQ(made.target, backup()) << "the suffixes are added";
  EXPECT_EQ(made.scans, 2U);
  EXPECT_THAT(made.problems, IsEmpty());
  EXPECT_THAT(Names(), ElementsAre("plumb.tar.age")) << "nothing stays beside it";
  EXPECT_EQ(fs::status(backup()).permissions(), fs::perms(0600));
  for (const char* text : {"scene.json of", "SQLite format", "pppppppp", "backup.json", "thorax"})
    EXPECT_EQ(Content().find(text), std::string::npos) << text;
  const fs::path opened = folder_ / "opened";
  fs::create_directories(opened);
  const RunResult age =
      plumb::Run({"/usr/bin/env", "age", "--decrypt", "-i", (folder_ / "id.txt").string(), "-o",
                  (folder_ / "plain.tar").string(), backup().string()});
  ASSERT_EQ(age.exit_code, 0) << age.err;
  const RunResult tar = plumb::Run(
      {"/usr/bin/env", "tar", "-x", "-C", opened.string(), "-f", (folder_ / "plain.tar").string()});
  ASSERT_EQ(tar.exit_code, 0) << tar.err;
  const RunResult sums = plumb::Run({"/usr/bin/env", "-C", opened.string(), "sha256sum", "--quiet",
                                     "--strict", "-c", "SHA256SUMS"});
  EXPECT_EQ(sums.exit_code, 0) << sums.out << sums.err;
  EXPECT_EQ(FilesOf(opened), FilesOf(state()));
  EXPECT_EQ(FilesBelow(opened).size(), made.files + 2);
  // What was opened by hand is a backup, too.
  EXPECT_EQ(RestoreBackup(opened, folder_ / "by-hand").scans, 2U);
  EXPECT_EQ(FilesOf(folder_ / "by-hand"), FilesOf(state()));
}

TEST_F(AgeBackupTest, WhatIsRestoredIsByteIdentical) {
  const BackupReport made = BackUp();
  const BackupReport verified = VerifyBackup(backup(), {}, {.identity = &identity_});
  EXPECT_EQ(verified.scans, 2U);
  EXPECT_EQ(verified.files, made.files);
  const auto before = FilesOf(state());
  const BackupReport report = RestoreBackup(backup(), restored(), {}, {.identity = &identity_});
  EXPECT_EQ(report.scans, 2U);
  EXPECT_EQ(report.files, made.files);
  EXPECT_EQ(report.bytes, made.bytes);
  EXPECT_EQ(FilesOf(restored()), before);
  Store store(restored());
  for (const Scan& scan : store.scans.List(patient_, 100))
    EXPECT_EQ(store.integrity.Check(scan.id, false).English(), "");
  Store from(state());
  ASSERT_EQ(from.audit.Find({0, 10, "backup.make"}).size(), 1U);
  EXPECT_THAT(from.audit.Find({0, 10, "backup.make"})[0].detail.English(),
              AllOf(HasSubstr(backup().string() + ": 2 scans"), HasSubstr(", encrypted")));
}

TEST_F(AgeBackupTest, EachOfTwoRecipientsOpensItAndNobodyElse) {
  (void)BackUp({kOtherRecipient, kRecipient});
  EXPECT_EQ(VerifyBackup(backup(), {}, {.identity = &identity_}).scans, 2U);
  EXPECT_EQ(VerifyBackup(backup(), {}, {.identity = &other_}).scans, 2U);
  (void)BackUp({kOtherRecipient});
  EXPECT_THAT(WhyNot(&identity_), HasSubstr("no identity matched"));
  EXPECT_THAT(WhyNot(nullptr), AllOf(HasSubstr("age"), HasSubstr("--identity")));
  const fs::path both = File("both.txt", std::string(kIdentity) + kOtherIdentity);
  const AgeIdentity of_both(both);
  EXPECT_EQ(VerifyBackup(backup(), {}, {.identity = &of_both}).scans, 2U);
  EXPECT_THAT(of_both.Recipients(), ElementsAre(kRecipient, kOtherRecipient));
}

TEST_F(AgeBackupTest, APlainOneInItsPlaceIsNotTakenForIt) {
  (void)BackUpStopped(state(), disk() / "plumb.tar");
  fs::rename(disk() / "plumb.tar", backup());
  EXPECT_THAT(WhyNot(&identity_), HasSubstr("not encrypted"));
}

TEST_F(AgeBackupTest, CutShortAnywhereItRestoresNothing) {
  (void)BackUp();
  const std::string whole = Content();
  for (const std::size_t length :
       {std::size_t{0}, std::size_t{21}, std::size_t{22}, std::size_t{100}, std::size_t{200},
        std::size_t{216}, std::size_t{65752}, whole.size() / 2, whole.size() - 1}) {
    WriteWholeFile(backup(), std::string_view(whole).substr(0, length));
    EXPECT_NE(WhyNot(&identity_), "") << length;
    EXPECT_THROW((void)VerifyBackup(backup(), {}, {.identity = &identity_}), DataError) << length;
  }
  WriteWholeFile(backup(), std::string_view(whole + "x"));
  EXPECT_NE(WhyNot(&identity_), "") << "nor with more behind its end";
}

TEST_F(AgeBackupTest, AFlippedByteAnywhereRestoresNothing) {
  (void)BackUp();
  const std::string whole = Content();
  for (const std::size_t at :
       {std::size_t{0}, std::size_t{21}, std::size_t{30}, std::size_t{80}, std::size_t{150},
        std::size_t{190}, std::size_t{300}, whole.size() / 2, whole.size() - 1}) {
    std::string changed = whole;
    changed[at] ^= 1;
    WriteWholeFile(backup(), std::string_view(changed));
    EXPECT_NE(WhyNot(&identity_), "") << at;
  }
}

TEST_F(AgeBackupTest, AFullDiskKeepsTheOlderOneAndLeavesNothingElse) {
  (void)BackUp();
  const std::string before = Content();
  EXPECT_EQ(testing::WriteOnFullDisk(400'000, [&] { (void)BackUp(); }),
            testing::WriteOutcome::kIoError);
  EXPECT_THAT(Names(), ElementsAre("plumb.tar.age"));
  EXPECT_EQ(Content(), before);
  fs::create_directories(restored());
  EXPECT_EQ(testing::WriteOnFullDisk(
                400'000,
                [&] { (void)RestoreBackup(backup(), restored(), {}, {.identity = &identity_}); }),
            testing::WriteOutcome::kIoError);
  EXPECT_THAT(FilesBelow(restored()), IsEmpty());
}

TEST_F(AgeBackupTest, WithoutTheProgramNothingIsWrittenAndThePackageIsNamed) {
  (void)BackUp();
  const std::string before = Content();
  const PathOf nothing(folder_ / "state");
  EXPECT_THAT(MessageOf<IoError>([&] { (void)BackUp(); }),
              AllOf(HasSubstr("program age"), HasSubstr("package age")));
  EXPECT_EQ(Content(), before);
  EXPECT_THAT(Names(), ElementsAre("plumb.tar.age"));
  EXPECT_THAT(MessageOf<IoError>(
                  [&] { (void)RestoreBackup(backup(), restored(), {}, {.identity = &identity_}); }),
              HasSubstr("package age"));
  EXPECT_FALSE(fs::exists(restored()));
}

TEST_F(AgeBackupTest, WhatAProgramOfThatNameSaysIsTold) {
  fs::create_directories(folder_ / "bin");
  const fs::path program = folder_ / "bin" / "age";
  const auto put = [&](std::string_view text) {
    fs::remove(program);
    WriteWholeFile(program, text);
    fs::permissions(program, fs::perms(0755));
  };
  const PathOf ours(folder_ / "bin");
  const auto why = [&] { return MessageOf<IoError>([&] { (void)BackUp(); }); };
  put("#!/bin/sh\necho 'age: error: no \x1b[31mluck' >&2\nexit 1\n");
  EXPECT_THAT(why(), HasSubstr("no [31mluck"));
  put("#!/bin/sh\nwhile :; do echo words || exit 1; done >&2\n");
  EXPECT_THAT(why(), HasSubstr("words")) << "what it says has an end";
  put("#!/bin/sh\nkill -9 $$\n");
  EXPECT_THAT(why(), HasSubstr("Killed"));
  put("#!/no/such/interpreter\n");
  EXPECT_THAT(why(), AllOf(HasSubstr(program.string()), HasSubstr("No such file")));
  put("#!/bin/sh\nprintf '%s' \"${HOME-none}$#\" >&2\nexit 1\n");
  EXPECT_THAT(why(), HasSubstr("none3")) << "it gets no environment";
  EXPECT_FALSE(fs::exists(backup()));
}

TEST_F(AgeBackupTest, AStopAndTheEndOfTheProcessEndTheProgram) {
  fs::create_directories(folder_ / "bin");
  const fs::path program = folder_ / "bin" / "age", pid_file = folder_ / "pid";
  WriteWholeFile(program, std::string_view("#!/bin/sh\necho $$ > " + pid_file.string() +
                                           "\nexec /bin/sleep 1000\n"));
  fs::permissions(program, fs::perms(0755));
  (void)BackUp();
  const PathOf ours(folder_ / "bin");
  const auto pid = [&] {
    pid_t number = 0;
    while (number == 0) std::ifstream(pid_file) >> number;
    fs::remove(pid_file);
    return number;
  };
  {
    std::stop_source stop;
    std::thread restore([&] {
      EXPECT_THROW((void)Decrypted(backup(), identity_, folder_.path(), stop.get_token()),
                   Interrupted);
    });
    const pid_t child = pid();
    stop.request_stop();
    restore.join();
    EXPECT_EQ(::kill(child, 0), -1) << "it was killed and reaped";
  }
  const pid_t parent = ::fork();
  if (parent == 0) {
    try {
      (void)Decrypted(backup(), identity_, folder_.path(), {});
    } catch (const std::exception&) {
    }
    ::_exit(0);
  }
  const pid_t child = pid();
  ::kill(parent, SIGKILL);
  ::waitpid(parent, nullptr, 0);
  // Readable as soon as the process has ended, reaped or not; no such process: it has.
  const auto process = static_cast<int>(::syscall(SYS_pidfd_open, child, 0));
  if (process >= 0) {
    pollfd ended{.fd = process, .events = POLLIN, .revents = 0};
    EXPECT_EQ(::poll(&ended, 1, 5000), 1) << "it outlived its parent by 5 s";
    ::close(process);
  } else {
    EXPECT_EQ(errno, ESRCH);
  }
  fs::remove_all(folder_ / "bin");
}

TEST_F(AgeBackupTest, ReplacesAnAgeFileOnly) {
  (void)BackUp();
  (void)BackUp();
  WriteWholeFile(backup(), std::string_view("the only copy of a thesis"));
  EXPECT_THAT(MessageOf<IoError>([&] { (void)BackUp(); }), HasSubstr("not an older backup"));
  EXPECT_EQ(Content(), "the only copy of a thesis");
}

TEST_F(AgeBackupTest, ANameForAnEncryptedOneWithoutARecipientIsRefused) {
  EXPECT_THAT(
      MessageOf<std::invalid_argument>([&] { (void)BackUpStopped(state(), backup()); }),
      AllOf(HasSubstr("no recipient"), HasSubstr("--recipient"), HasSubstr("backup_recipients")));
  EXPECT_FALSE(fs::exists(backup()));
  EXPECT_EQ(EncryptedName("a", {}), "a");
  const AgeRecipients one({kRecipient});
  EXPECT_EQ(EncryptedName("/x/a", one), "/x/a.tar.age");
  EXPECT_EQ(EncryptedName("/x/a.tar", one), "/x/a.tar.age");
  EXPECT_EQ(EncryptedName("/x/a.age", one), "/x/a.age");
}

TEST_F(AgeBackupTest, AFileThatCannotBeReadToItsEndIsNamedAndTheRestIsThere) {
  const fs::path short_file = "/sys/devices/system/cpu/online";  // says that it has 4096 bytes
  const fs::path file = folder_ / "some.tar";
  TarWriter tar(file);
  const TarWriter::Added added = tar.Add(short_file.parent_path(), "online", {});
  tar.AddText("next", "text");
  tar.Close();
  EXPECT_EQ(added.digest.bytes, 4096U);
  EXPECT_THAT(added.problem.English(), AllOf(HasSubstr(short_file.string()), HasSubstr("zeros")));
  const TarReader reader(file);
  EXPECT_EQ(reader.Digest("online", {}).sha256, added.digest.sha256);
  EXPECT_EQ(reader.Text("online", 4096).substr(0, 2), "0-");
  EXPECT_EQ(reader.Text("next", 4096), "text");
}

TEST_F(AgeBackupTest, APatientGoesEncryptedToo) {
  const fs::path there = folder_ / "there", out = folder_ / "px.tar.age";
  { const Store store(there); }
  EXPECT_EQ(ExportPatient(state(), "P", folder_ / "px", {}, AgeRecipients({kRecipient})).scans, 2U);
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ImportPatient(out, there); }),
              HasSubstr("--identity"));
  EXPECT_THAT(
      MessageOf<DataError>([&] { (void)ImportPatient(out, there, {}, {.identity = &other_}); }),
      HasSubstr("no identity matched"));
  EXPECT_EQ(ImportPatient(out, there, {}, {.identity = &identity_}).scans, 2U);
}

TEST(AgeRecipientsTest, ATypingErrorIsNoticed) {
  EXPECT_TRUE(IsAgeRecipient(kRecipient));
  EXPECT_TRUE(IsAgeRecipient(kOtherRecipient));
  const std::string key = kRecipient;
  for (std::size_t i = 0; i < key.size(); ++i) {
    std::string wrong = key;
    wrong[i] = wrong[i] == 'q' ? 'p' : 'q';
    EXPECT_FALSE(IsAgeRecipient(wrong)) << i;
  }
  for (const std::string& text :
       {std::string(), key + "q", key.substr(1), std::string("AGE-SECRET-KEY-1"), "-" + key,
        std::string("age1"), std::string(62, '-')})
    EXPECT_FALSE(IsAgeRecipient(text)) << text;
  EXPECT_THAT(MessageOf<DataError>([&] {
                AgeRecipients({key, "age1abc"});
              }),
              AllOf(HasSubstr("'age1abc'"), HasSubstr("age-keygen")));
  EXPECT_THROW(AgeRecipients(std::vector<std::string>(17, key)), DataError);
}

/// As `age` does; each of these has a right checksum.
TEST(AgeRecipientsTest, AKeyThatAgeCannotUseIsRefused) {
  for (const char* key : {
           "age1qqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqq5cu47z",
           "age1qqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqzqqsuwj9m",
           "age1qyqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqj7vrya",
           "age1qyqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqzqqk67yly",
           "age1ur4h5lpmgxu2u9jku0a0r87ydtdqnr0tnsetrlvxvgz3vh6fhqqqzyt4v9",
           "age1ur4h5lpmgxu2u9jku0a0r87ydtdqnr0tnsetrlvxvgz3vh6fhzqqqxqejhu",
           "age1t7wft09r2zxzfvwsk92eeql0tvzyghxytqwgapkcyf8dm5ylz9ts6wm9s8",
           "age1t7wft09r2zxzfvwsk92eeql0tvzyghxytqwgapkcyf8dm5ylz8ts72fzt7",
           "age1anlllllllllllllllllllllllllllllllllllllllllllllllals4n2t7m",
           "age1ahlllllllllllllllllllllllllllllllllllllllllllllllalsn46ayy",
           "age1amlllllllllllllllllllllllllllllllllllllllllllllllalselrwrv",
           // bits behind the key that are not 0
           "age1pyqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqpa3h085",
       }) {
    EXPECT_FALSE(IsAgeRecipient(key)) << key;
    const RunResult age =
        plumb::Run({"/usr/bin/env", "age", "-r", key, "-o", "/dev/null", "/dev/null"});
    EXPECT_NE(age.exit_code, 0) << key;
  }
  EXPECT_TRUE(IsAgeRecipient("age1pyqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqqq8r66x"));
}

TEST(AgeRecipientsTest, AFileHasOneInEachLine) {
  const testing::TempFolder folder;
  const auto read = [&](const std::string& text) {
    WriteWholeFile(folder / "keys", std::string_view(text));
    return AgeRecipients::FromFile(folder / "keys");
  };
  EXPECT_THAT(read(fmt::format("# office\r\n{}\r\n\n{}", kRecipient, kOtherRecipient)).keys(),
              ElementsAre(kRecipient, kOtherRecipient));
  for (const std::string& text :
       {std::string(), std::string("# none\n"), std::string(kIdentity), std::string(70'000, '#')})
    EXPECT_ANY_THROW((void)read(text)) << text.substr(0, 40);
}

TEST(AgeIdentityTest, WhatIsNoneIsRefused) {
  const testing::TempFolder folder;
  const auto why = [&](const std::string& text) {
    WriteWholeFile(folder / "id", std::string_view(text));
    return MessageOf<DataError>([&] { const AgeIdentity identity(folder / "id"); });
  };
  EXPECT_THAT(why(kRecipient), HasSubstr("AGE-SECRET-KEY-1"));
  EXPECT_THAT(why("age-encryption.org/v1\n-> scrypt x 18\n"), HasSubstr("passphrase"));
  WriteWholeFile(folder / "id", std::string_view("AGE-SECRET-KEY-1ABC\n"));
  EXPECT_THROW((void)AgeIdentity(folder / "id").Recipients(), DataError);
}

TEST(AgeIdentityTest, WhatAnEditorHasPutAroundItIsNamed) {
  const testing::TempFolder folder;
  const std::string key = std::string(kOtherIdentity, std::strlen(kOtherIdentity) - 1);
  for (const std::string& text :
       {"\xEF\xBB\xBF" + key, " " + key, key + " ", key + "\t\n", "# mine\n  " + key + "\n"}) {
    WriteWholeFile(folder / "id", std::string_view(text));
    EXPECT_THAT(MessageOf<DataError>([&] { const AgeIdentity identity(folder / "id"); }),
                HasSubstr("byte order mark"));
  }
  for (const std::string& text : {key, key + "\r\n", "# a key, " + key + " \n" + key + "\n"}) {
    WriteWholeFile(folder / "id", std::string_view(text));
    EXPECT_THAT(AgeIdentity(folder / "id").Recipients(), ElementsAre(kOtherRecipient)) << text;
  }
}

}  // namespace
}  // namespace plumb
