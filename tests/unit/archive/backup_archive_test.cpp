// SPDX-License-Identifier: Apache-2.0
// Backups that are one file: what they replace, what is restored of them, and what is refused.
#include <algorithm>
#include <array>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/archive/backup.hpp"
#include "daemon/archive/patient_transfer.hpp"
#include "daemon/archive/store_backup.hpp"
#include "daemon/archive/tar_file.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
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
using testing::kAnna;
using testing::MessageOf;
using testing::NamesIn;
using testing::StoreScan;

constexpr std::size_t kBlock = 512;

/// One entry of an archive, with a header as every tar writes it.
/// @param fields  What the header has instead, by its position.
std::string TarEntry(const std::string& name, char type, const std::string& content = {},
                     const std::string& link = {},
                     const std::map<std::size_t, std::string>& fields = {}) {
  std::string header(kBlock, '\0');
  const auto put = [&](std::size_t at, const std::string& text) {
    header.replace(at, text.size(), text);
  };
  put(0, name);
  put(100, "0000640");
  put(108, "0000000");
  put(116, "0000000");
  put(124, fmt::format("{:011o}", content.size()));
  put(136, "00000000000");
  put(148, "        ");
  put(156, std::string(1, type));
  put(157, link);
  put(257, std::string("ustar\0"
                       "00",
                       8));
  for (const auto& [at, text] : fields) put(at, text);
  unsigned sum = 0;
  for (const unsigned char byte : header) sum += byte;
  put(148, fmt::format("{:06o}", sum) + std::string(1, '\0'));
  std::string padded = content;
  padded.resize((content.size() + kBlock - 1) / kBlock * kBlock, '\0');
  return header + padded;
}

/// The size of an entry as a binary number, for more than eleven octal digits can state.
std::string BinarySize(std::uint64_t bytes) {
  std::string field(12, '\0');
  field[0] = '\x80';
  for (std::size_t i = 0; i < sizeof bytes; ++i)
    field[11 - i] = static_cast<char>(bytes >> (8 * i));
  return field;
}

/// An empty file "scans/pax", preceded by a pax header with one record that replaces what its own
/// header states. @param record  So short that its length has two digits, as in "path=x".
std::string PaxEntry(const std::string& record) {
  return TarEntry("PaxHeaders/" + record, 'x', fmt::format("{} {}\n", record.size() + 4, record)) +
         TarEntry("scans/pax", '0');
}

class BackupArchiveTest : public ::testing::Test {
 protected:
  BackupArchiveTest() {
    Store store(state());
    patient_ = store.patients.Add(kAnna, "P", "thorax");
    for (int i = 0; i < 2; ++i) scan_ = StoreScan(store, patient_);
    fs::create_directories(state() / "calibration");
    // Longer than what is read at once, and as long as nothing; the name is longer than a header's.
    WriteWholeFile(state() / "calibration" / (std::string(150, 'l') + "\xC3\xA4.yaml"),
                   std::string_view(std::string(700'000, 'p')));
    WriteWholeFile(state() / "calibration" / "empty.yaml", std::string_view());
  }
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  [[nodiscard]] fs::path places() const { return folder_ / "disk"; }  ///< Has the archive only.
  [[nodiscard]] fs::path backup() const { return places() / "plumb.tar"; }
  [[nodiscard]] fs::path restored() const { return folder_ / "restored"; }

  [[nodiscard]] std::vector<std::string> Names() const { return NamesIn(places()); }
  static auto FilesOf(const fs::path& folder) { return FilesOfState(folder); }
  [[nodiscard]] std::string Content() const { return ContentOf(backup()); }
  void Put(const std::string& content) const {
    fs::remove(backup());
    WriteWholeFile(backup(), std::string_view(content));
  }
  /// Why nothing is restored; nothing is written then.
  [[nodiscard]] std::string WhyNot() const {
    const std::string why =
        MessageOf<DataError>([&] { (void)RestoreBackup(backup(), restored()); });
    EXPECT_THAT(why, HasSubstr("nothing was restored"));
    EXPECT_FALSE(fs::exists(restored()));
    return why;
  }

  testing::TempFolder folder_;
  std::string patient_, scan_;
};

TEST_F(BackupArchiveTest, WhatIsRestoredIsByteIdentical) {
  const auto before = FilesOf(state());
  const BackupReport made = BackUpStopped(state(), backup());
  EXPECT_EQ(made.scans, 2U);
  EXPECT_EQ(made.files, 1U + 2 * 7 + 2);
  EXPECT_THAT(made.problems, ::testing::IsEmpty());
  EXPECT_THAT(Names(), ElementsAre("plumb.tar")) << "nothing stays beside it";
  EXPECT_EQ(fs::status(backup()).permissions(), fs::perms(0600)) << "it has patients' data";
  const BackupReport report = RestoreBackup(backup(), restored());
  EXPECT_EQ(report.scans, 2U);
  EXPECT_EQ(report.files, made.files);
  EXPECT_EQ(report.bytes, made.bytes);
  EXPECT_EQ(FilesOf(restored()), before);
  Store store(restored());
  for (const Scan& scan : store.scans.List(patient_, 100))
    EXPECT_EQ(store.integrity.Check(scan.id, false).English(), "");
  ASSERT_EQ(store.audit.Find({0, 10, "backup.restore"}).size(), 1U);
  EXPECT_THAT(store.audit.Find({0, 10, "backup.restore"})[0].detail.English(),
              HasSubstr(backup().string() + ": 2 scans"));
}

TEST_F(BackupArchiveTest, HoldsWhatAFolderWouldHold) {
  fs::copy(state(), folder_ / "same", fs::copy_options::recursive);
  (void)BackUpStopped(state(), places() / "folder");
  (void)BackUpStopped(folder_ / "same", backup());
  const auto folder = FilesBelow(places() / "folder");
  const TarReader tar(backup());
  EXPECT_EQ(tar.entries().size(), folder.size());
  for (const auto& [name, content] : folder) {
    if (name == "backup.json") continue;  // when it was made
    EXPECT_EQ(tar.Text(name, std::size_t{1} << 26), content) << name;
  }
  EXPECT_EQ(tar.Text("backup.json", 1U << 16U).size(), folder.at("backup.json").size());
}

TEST_F(BackupArchiveTest, OfARunningStoreReplacesTheOneBefore) {
  Store store(state());
  EXPECT_EQ(StoreBackup(store).Make(kAnna, backup()).scans, 2U);
  (void)StoreScan(store, patient_);
  EXPECT_EQ(StoreBackup(store).Make(kAnna, backup()).scans, 3U);
  EXPECT_THAT(Names(), ElementsAre("plumb.tar"));
  EXPECT_EQ(RestoreBackup(backup(), restored()).scans, 3U);
  EXPECT_EQ(store.audit.Find({0, 10, "backup.make"}).size(), 2U);
}

TEST_F(BackupArchiveTest, OfAStoppedStoreIsInItsLog) {
  const BackupReport made = BackUpStopped(state(), backup());
  Store store(state());
  const auto entries = store.audit.Find({0, 10, "backup.make"});
  ASSERT_EQ(entries.size(), 1U);
  EXPECT_EQ(entries[0].user, "command line");
  EXPECT_EQ(entries[0].detail.English(), fmt::format("{}: 2 scans, {} files, {} bytes, 0 problems",
                                                     backup().string(), made.files, made.bytes));
  EXPECT_EQ(store.audit.FirstBroken(), std::nullopt);
}

TEST_F(BackupArchiveTest, AnotherFileOrFolderOfItsNameIsNotReplaced) {
  fs::create_directories(places());
  const auto expect_kept = [&](const std::string& content) {
    Put(content);
    EXPECT_THAT(MessageOf<IoError>([&] { (void)BackUpStopped(state(), backup()); }),
                AllOf(HasSubstr(backup().string()), HasSubstr("not an older backup")));
    EXPECT_EQ(Content(), content);
    EXPECT_THAT(Names(), ElementsAre("plumb.tar"));
  };
  expect_kept("");
  expect_kept("the only copy of a thesis");
  expect_kept(TarEntry("thesis.tex", '0', "x") + std::string(2 * kBlock, '\0'));
  expect_kept(TarEntry("backup.json", '0', "{}") + TarEntry("SHA256SUMS", '0', "x") +
              std::string(2 * kBlock, '\0'));
  (void)ExportPatient(state(), "P", folder_ / "patient.tar");
  fs::copy(folder_ / "patient.tar", backup(), fs::copy_options::overwrite_existing);
  expect_kept(Content());
  fs::remove(backup());
  fs::create_directories(backup());
  EXPECT_THROW((void)BackUpStopped(state(), backup()), IoError);
  EXPECT_TRUE(fs::is_directory(backup()));
  fs::remove(backup());
  fs::create_symlink(folder_ / "nowhere", backup());
  EXPECT_THROW((void)BackUpStopped(state(), backup()), IoError);
  EXPECT_TRUE(fs::is_symlink(backup()));
}

TEST_F(BackupArchiveTest, CutShortAnywhereItRestoresNothing) {
  (void)BackUpStopped(state(), backup());
  const std::string whole = Content();
  const std::size_t end = whole.rfind('}');  // of backup.json, which is the last
  for (std::size_t length = 0; length < end; length += length < 2 * kBlock ? 100 : 9973) {
    Put(whole.substr(0, length));
    EXPECT_NE(WhyNot(), "") << length;
  }
  Put(whole.substr(0, end));
  EXPECT_NE(WhyNot(), "");
}

TEST_F(BackupArchiveTest, AFlippedByteOfAFileOrItsHeaderRestoresNothing) {
  (void)BackUpStopped(state(), backup());
  const std::string whole = Content();
  const auto flipped = [&](std::size_t at) {
    std::string changed = whole;
    changed[at] ^= 1;
    Put(changed);
    return WhyNot();
  };
  EXPECT_THAT(flipped(whole.find("SQLite format")), HasSubstr("plumb.db"));
  EXPECT_THAT(flipped(whole.find("scene/cloud.ply of")), HasSubstr("scene/cloud.ply"));
  EXPECT_THAT(flipped(whole.find("pppppppp") + 500'000), HasSubstr("1 of 17 files"));
  for (const std::size_t at : {0, 50, 105, 130, 150, 156})  // name, mode, size, sum, type
    EXPECT_THAT(flipped(at), HasSubstr("damaged")) << at;
  const std::size_t sums = whole.rfind("SHA256SUMS", whole.rfind("\"format\""));
  EXPECT_THAT(flipped(sums + kBlock), HasSubstr("SHA256SUMS is not the one that was written"));
}

TEST_F(BackupArchiveTest, WhatIsNoPlainFileOfABackupIsRefused) {
  (void)BackUpStopped(state(), backup());
  const std::string whole = Content();
  // A GNU header with one piece of 512 bytes at the end of a file of 32 KiB.
  const std::map<std::size_t, std::string> sparse = {{257, std::string("ustar  \0", 8)},
                                                     {386, "00000077000"},
                                                     {398, "00000001000"},
                                                     {483, "00000100000"}};
  const std::map<std::string, std::string> refused = {
      {TarEntry("scans/link", '2', "", "/etc/passwd"), "not a plain file"},
      {TarEntry("scans/hard", '1', "", "plumb.db"), "not a plain file"},
      {TarEntry("scans/folder/", '5'), "not plain"},
      {TarEntry("scans/fifo", '6'), "not a plain file"},
      {TarEntry("scans/device", '3'), "not a plain file"},
      {TarEntry("/etc/evil", '0', "x"), "not plain"},
      {TarEntry("../evil", '0', "x"), "not plain"},
      {TarEntry("scans/../../evil", '0', "x"), "not plain"},
      {TarEntry("./plumb.db", '0', "x"), "not plain"},
      {TarEntry("scans/a\tb", '0', "x"), "not plain"},
      {TarEntry("other/file", '0', "x"), "does not belong to a backup"},
      {TarEntry("plumb.db", '0', "x"), "plumb.db twice"},
      {TarEntry("SHA256SUMS", '0', "x"), "SHA256SUMS twice"},
      {TarEntry("backup.json", '0', "x"), "backup.json twice"},
      {TarEntry("scans/000001/scene/more", '0', "x"), "files, "},
      {TarEntry("scans/2^40", '0', "x", "", {{124, BinarySize(1ULL << 40U)}}),
       "ends within scans/"},
      {TarEntry("scans/2^63", '0', "x", "", {{124, BinarySize(1ULL << 63U)}}), "damaged"},
      {TarEntry("scans/minus", '0', "x", "", {{124, std::string(12, '\xFF')}}), "damaged"},
      {TarEntry("scans/sparse", 'S', std::string(kBlock, 'x'), "", sparse), "not a plain file"},
      {PaxEntry("path=../evil"), "not plain"},
      {PaxEntry("path=/etc/evil"), "not plain"},
      {PaxEntry("path=plumb.db"), "plumb.db twice"},
      {PaxEntry("GNU.sparse.name=../evil"), "not plain"},
      {PaxEntry("size=1099511627776"), "ends within scans/"},
      {PaxEntry("size=9223372036854775808"), "damaged"},
  };
  for (const auto& [entry, why] : refused) {
    Put(entry + whole);
    EXPECT_THAT(WhyNot(), HasSubstr(why)) << entry.substr(0, 30);
  }
  EXPECT_FALSE(fs::exists(folder_ / "evil"));
}

TEST_F(BackupArchiveTest, WhatIsNoArchiveIsRefused) {
  fs::create_directories(places());
  std::string gzip = {'\x1f', '\x8b', '\x08'};
  gzip.resize(2000, 'z');
  for (const std::string& content : {std::string(), std::string("x"), std::string(5000, '\0'),
                                     std::string(5000, 'x'), gzip, std::string("#!/bin/sh\n")}) {
    Put(content);
    EXPECT_NE(WhyNot(), "");
  }
}

TEST_F(BackupArchiveTest, AStopLeavesNothing) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW((void)BackUpStopped(state(), backup(), stop.get_token()), Interrupted);
  EXPECT_FALSE(fs::exists(places())) << "nor the folder that was made for it";
}

TEST_F(BackupArchiveTest, IsNotMadeInsideTheFolderThatItIsOf) {
  EXPECT_THAT(MessageOf<std::invalid_argument>(
                  [&] { (void)BackUpStopped(state(), state() / "scans" / "plumb.tar"); }),
              HasSubstr("inside the state folder"));
}

TEST_F(BackupArchiveTest, APatientGoesInOneFileToo) {
  const fs::path out = folder_ / "patient.tar", there = folder_ / "there";
  { Store store(there); }
  EXPECT_EQ(ExportPatient(state(), "P", out).scans, 2U);
  EXPECT_TRUE(fs::is_regular_file(out));
  EXPECT_EQ(ImportPatient(out, there).scans, 2U);
  Store from(state()), to(there);
  const auto patient = to.patients.FindByCode("P");
  ASSERT_TRUE(patient);
  const auto before = from.scans.List(patient_, 10), now = to.scans.List(patient->id, 10);
  ASSERT_EQ(now.size(), before.size());
  for (std::size_t i = 0; i < now.size(); ++i)
    EXPECT_EQ(FilesBelow(now[i].folder), FilesBelow(before[i].folder));
}

}  // namespace
}  // namespace plumb
