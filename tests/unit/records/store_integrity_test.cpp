// SPDX-License-Identifier: Apache-2.0
// What is stored is held against what was stored.
#include <sstream>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/records/scan_folder.hpp"
#include "words/store.hpp"
#include "words/text.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::kAnna;
using testing::kBert;
using ::testing::Not;
using testing::PlanAndApprove;
using testing::StoreScan;

class StoreIntegrityTest : public ::testing::Test {
 protected:
  StoreIntegrityTest() : store_(folder_ / "state") {
    patient_ = store_.patients.Add(kAnna, "P", "");
    scan_ = StoreScan(store_, patient_);
  }
  [[nodiscard]] fs::path File(const std::string& name) const {
    return store_.folders.Scan(scan_) / name;
  }
  /// One byte becomes another; size and all else stay.
  void Flip(const std::string& name) const {
    auto bytes = ReadWholeFile(File(name), 1 << 20);
    bytes[bytes.size() / 2] ^= 1;
    WriteWholeFile(File(name), bytes);
  }

  testing::TempFolder folder_;
  Store store_;
  std::string patient_, scan_;
};

TEST_F(StoreIntegrityTest, TheDigestIsSha256) {
  WriteWholeFile(folder_ / "abc", std::string_view("abc"));
  const FileDigest digest = DigestOfFile(folder_.path(), "abc");
  EXPECT_EQ(digest.sha256, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(digest.bytes, 3U);
  WriteWholeFile(folder_ / "long", std::string(1'000'000, 'a'));  // more than one piece
  EXPECT_EQ(DigestOfFile(folder_.path(), "long").sha256,
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST_F(StoreIntegrityTest, OneFlippedBitInAnyFileIsFoundAndNamed) {
  EXPECT_EQ(store_.integrity.Check(scan_, false).English(), "");
  for (const std::string file : testing::kScanFiles) {
    Flip(file);
    EXPECT_THAT(store_.integrity.Check(scan_, false).English(),
                AllOf(HasSubstr(file), HasSubstr("changed")));
    EXPECT_TRUE(store_.scans.Find(scan_)->folder.empty());
    EXPECT_THAT(store_.scans.Find(scan_)->failure.English(), HasSubstr(file));
    EXPECT_EQ(store_.audit.Find({0, 1}).at(0).action, "scan.unavailable");
    EXPECT_EQ(store_.integrity.Check(scan_, true).empty(), file.starts_with("result/"))
        << "a comparison reads the scene alone";
    Flip(file);
    EXPECT_EQ(store_.integrity.Check(scan_, false).English(), "");
    EXPECT_FALSE(store_.scans.Find(scan_)->folder.empty());
    EXPECT_EQ(store_.audit.Find({0, 1}).at(0).action, "scan.available");
  }
}

TEST_F(StoreIntegrityTest, AFileThatCameLaterIsNotTakenForAStoredOne) {
  WriteWholeFile(File("scene/extra.ply"), std::string_view("x"));
  EXPECT_EQ(store_.integrity.Check(scan_, false).English(), "");
  fs::remove(File("scene/extra.ply"));
  EXPECT_EQ(store_.integrity.Check(scan_, false).English(), "");
}

TEST_F(StoreIntegrityTest, ARecordingIsNotedWhenFirstSeenAndMayGoForTheQuota) {
  fs::create_directory(File("recording"));
  for (const char* name : {"rgb.txt", "depth.txt"})
    WriteWholeFile(File("recording") / name, std::string(10'000, name[0]));
  EXPECT_EQ(store_.integrity.Check(scan_, false).English(), "");
  Flip("recording/depth.txt");
  EXPECT_THAT(store_.integrity.Check(scan_, false).English(), HasSubstr("recording"));
  EXPECT_EQ(store_.integrity.Check(scan_, true).English(), "") << "no comparison reads it";
  Flip("recording/depth.txt");
  EXPECT_EQ(store_.integrity.Check(scan_, false).English(), "");
  EXPECT_EQ(store_.removal.KeepWithinQuota(10'000, testing::kAtOnce).removed, 1);
  EXPECT_FALSE(fs::exists(File("recording")));
  EXPECT_EQ(store_.integrity.Check(scan_, false).English(), "") << "it was removed on purpose";
}

TEST_F(StoreIntegrityTest, AResultThatIsNotThatOfItsFileIsNeverShown) {
  ASSERT_TRUE(store_.scans.Find(scan_)->result);
  store_.database().ForChanges()->Run(
      "UPDATE results SET json = replace(json, '{', '{ ') WHERE scan_id = ?", scan_);
  EXPECT_THAT(testing::MessageOf<DataError>([&] { (void)store_.scans.Find(scan_); }),
              HasSubstr("is not that of its result.json"));
  const std::vector<Scan> listed = store_.scans.List(patient_, 9);
  ASSERT_FALSE(listed.empty());
  EXPECT_FALSE(listed[0].result);
  EXPECT_THAT(listed[0].failure.English(), HasSubstr("is not that of its result.json"));
  EXPECT_THROW(store_.scans.Accept(kAnna, scan_, ""), DataError);
}

TEST_F(StoreIntegrityTest, ScansAreCheckedInTurnAndNotTooOften) {
  const std::string second = StoreScan(store_, patient_);
  using std::chrono::hours;
  EXPECT_EQ(store_.integrity.CheckNext(hours(24))->id, scan_);
  Flip("scene/cloud.ply");
  EXPECT_EQ(store_.integrity.CheckNext(hours(24))->id, second);
  EXPECT_FALSE(store_.integrity.CheckNext(hours(24)));
  const auto checked = store_.integrity.CheckNext(hours(0));
  ASSERT_TRUE(checked);
  EXPECT_EQ(checked->id, scan_);
  EXPECT_THAT(checked->fault.English(), HasSubstr("scene/cloud.ply"));
}

TEST_F(StoreIntegrityTest, AReferenceIsApprovedOnlyAsItWasStored) {
  const std::string reference = store_.references.Add(kAnna, scan_, "", {});
  Flip("scene/heightmap.tiff");
  EXPECT_THAT(
      testing::MessageOf<StoreRefusal>([&] { store_.references.Approve(kBert, reference, 1); }),
      HasSubstr("scene/heightmap.tiff"));
  EXPECT_FALSE(store_.references.Approved(patient_));
  Flip("scene/heightmap.tiff");
  (void)PlanAndApprove(store_, reference);
  EXPECT_TRUE(store_.references.Approved(patient_));
}

TEST_F(StoreIntegrityTest, APlanThatIsNotAsApprovedIsNeverUsed) {
  const std::string id = PlanAndApprove(store_, store_.references.Add(kAnna, scan_, "first", {}));
  ASSERT_TRUE(store_.references.Approved(patient_));
  const StoreDatabase::Held direct = store_.database().ForChanges();
  EXPECT_THROW(direct->Execute("UPDATE refs SET approved_digest = 'x'"), ConstraintBroken);
  direct->Execute("DROP TRIGGER refs_immutable");
  const auto replace = [&](const char* from, const char* to) {
    direct->Run("UPDATE refs SET plan = replace(plan, ?, ?)", from, to);
  };
  replace("\"shift_tolerance_mm\":", "\"shift_tolerance_mm\":1");  // ten times as much
  const auto named = HasSubstr("not as it was approved");
  EXPECT_THAT(testing::MessageOf<DataError>([&] { (void)store_.references.Approved(patient_); }),
              named);
  EXPECT_THAT(testing::MessageOf<DataError>([&] { (void)store_.references.Find(id); }), named);
  EXPECT_THAT(store_.references.List(patient_).front().unreadable.English(), named);
  replace("\"shift_tolerance_mm\":1", "\"shift_tolerance_mm\":");
  EXPECT_TRUE(store_.references.Approved(patient_));
}

TEST_F(StoreIntegrityTest, TheDigestOfAStoredFileCannotBeChanged) {
  Database direct(folder_ / "state" / "plumb.db", Database::Access::kReadWrite);
  EXPECT_THROW(direct.Execute("UPDATE scan_files SET sha256 = 'x'"), ConstraintBroken);
}

TEST_F(StoreIntegrityTest, TheAuditLogShowsWhatWasChangedInItOrTakenFromIt) {
  for (int i = 0; i < 5; ++i) store_.audit.Log(kAnna, "note", std::to_string(i), "text");
  ASSERT_EQ(store_.audit.FirstBroken(), std::nullopt);
  const std::string exported = store_.audit.Export();
  EXPECT_EQ(CheckAuditExport(exported).number, store_.audit.Head().number);
  EXPECT_EQ(CheckAuditExport(exported).chain, store_.audit.Head().chain);
  Database direct(folder_ / "state" / "plumb.db", Database::Access::kReadWrite);
  direct.Execute("DROP TRIGGER audit_no_update; DROP TRIGGER audit_no_delete");
  const auto number = store_.audit.Find({0, 3}).at(2).number;
  const auto restore = [&](const std::string& detail) {
    direct.Execute(fmt::format("UPDATE audit SET detail = '{}' WHERE number = {}", detail, number));
  };
  restore("texT");
  EXPECT_EQ(store_.audit.FirstBroken(), number);
  const auto named = HasSubstr(fmt::format("entry {} is not as it was written", number));
  EXPECT_THAT(testing::MessageOf<DataError>([&] { (void)CheckAuditExport(store_.audit.Export()); }),
              named);
  EXPECT_THAT(testing::MessageOf<DataError>([&] {
                std::string lines = exported;  // changed in the file that was downloaded
                lines.replace(lines.find("\"detail\":\"text\""), 15, "\"detail\":\"tex.\"");
                (void)CheckAuditExport(lines);
              }),
              HasSubstr("is not as it was written"));
  EXPECT_EQ(CheckAuditExport(exported.substr(exported.find('\n') + 1)).chain,
            CheckAuditExport(exported).chain)
      << "without its first entry the rest can be checked";
  restore("text");
  EXPECT_EQ(store_.audit.FirstBroken(), std::nullopt);
  direct.Execute(fmt::format("DELETE FROM audit WHERE number > {}", number));
  EXPECT_EQ(store_.audit.FirstBroken(), number + 1) << "the newest entries are gone";
  direct.Execute(fmt::format("DELETE FROM audit WHERE number = {}", number - 1));
  EXPECT_EQ(store_.audit.FirstBroken(), number - 1);
  EXPECT_THAT(testing::MessageOf<DataError>([&] { (void)CheckAuditExport(store_.audit.Export()); }),
              HasSubstr(fmt::format("entry {} is not", number - 1)));
}

TEST_F(StoreIntegrityTest, TheAuditLogKeepsMessagesUnderTheDigestsOf020) {
  store_.audit.Log(kAnna, "note", "1", say::store::LogLost(2, 5));
  store_.audit.Log(kAnna, "note", "2",
                   "a person's\x1f{\"id\":\"store.log_quota\",\"arguments\":{}}");
  const auto entries = store_.audit.Find({0, 2, "note"});
  EXPECT_EQ(entries[1].detail, say::store::LogLost(2, 5));
  EXPECT_EQ(entries[1].detail.English(), "2 of 5 stored scans were confirmed as lost");
  EXPECT_TRUE(entries[0].detail.Is(say::text::kVerbatim)) << "never taken for a message";
  std::string before;
  std::istringstream lines(store_.audit.Export());
  for (std::string line; std::getline(lines, line);) {
    const auto entry = nlohmann::json::parse(line);
    std::string text = fmt::format("{}\n{}\n{}\n", before, entry.at("number").get<int>(),
                                   entry.at("time_us").get<std::int64_t>());
    for (const char* name : {"user", "address", "action", "subject", "detail"}) {
      const auto field = entry.at(name).get<std::string>();
      text += fmt::format("{}:{}\n", field.size(), field);
    }
    before = Sha256Of(text);
    EXPECT_EQ(entry.at("chain"), before) << line;
  }
  EXPECT_EQ(before, store_.audit.Head().chain);
  Database direct(folder_ / "state" / "plumb.db", Database::Access::kReadWrite);
  direct.Execute(
      "DROP TRIGGER audit_no_update; UPDATE audit SET detail = replace(detail, '\"missing\":2', "
      "'\"missing\":3')");
  EXPECT_EQ(store_.audit.Find({0, 2, "note"})[1].detail, say::store::LogLost(3, 5));
  EXPECT_EQ(store_.audit.FirstBroken(), entries[1].number) << "the digests cover the message";
}

TEST_F(StoreIntegrityTest, AnEntryOfTheAuditLogThatIsNotUtf8IsExportedAsItWasWritten) {
  store_.audit.Log(kAnna, "note", "\xC3\xA4", "/media/\xE4\xFF is full");  // a path in Latin-1
  ASSERT_EQ(store_.audit.FirstBroken(), std::nullopt);
  const std::string exported = store_.audit.Export();
  EXPECT_EQ(CheckAuditExport(exported).chain, store_.audit.Head().chain);
  EXPECT_THAT(exported, AllOf(HasSubstr("\"detail\":\"/media/\xEF\xBF\xBD\xEF\xBF\xBD is full\""),
                              HasSubstr(",228,255,"), Not(HasSubstr("subject_bytes"))));
  for (const auto& [from, to] :
       {std::pair("228,255", "228,254"), std::pair("is full", "is fine")}) {
    std::string lines = exported;
    lines.replace(lines.find(from), 7, to);
    EXPECT_THAT(testing::MessageOf<DataError>([&] { (void)CheckAuditExport(lines); }),
                HasSubstr("is not as it was written"))
        << to;
  }
}

TEST_F(StoreIntegrityTest, UnusableFilesAreCountedUntilTheyAreBackOrTheirPatientIsArchived) {
  EXPECT_EQ(store_.integrity.CountUnusable(), UnusableRecords());
  Flip("scene/cloud.ply");
  EXPECT_EQ(store_.integrity.CountUnusable(), UnusableRecords()) << "nobody has looked yet";
  (void)store_.integrity.Check(scan_, false);
  EXPECT_EQ(store_.integrity.CountUnusable(), (UnusableRecords{.scans = 1, .references = 0}));
  Flip("scene/cloud.ply");
  (void)store_.integrity.Check(scan_, false);
  EXPECT_EQ(store_.integrity.CountUnusable(), UnusableRecords());
  (void)PlanAndApprove(store_, store_.references.Add(kAnna, scan_, "", {}));
  Flip("scene/cloud.ply");
  (void)store_.integrity.Check(scan_, true);
  EXPECT_EQ(store_.integrity.CountUnusable(), (UnusableRecords{.scans = 1, .references = 1}));
  const std::string draft = store_.references.Add(kAnna, StoreScan(store_, patient_), "", {});
  EXPECT_EQ(store_.integrity.CountUnusable().references, 1) << "a draft replaces nothing";
  (void)PlanAndApprove(store_, draft);
  EXPECT_EQ(store_.integrity.CountUnusable(), (UnusableRecords{.scans = 1, .references = 0}));
  Database(store_.folders.state() / "plumb.db", Database::Access::kReadWrite)
      .Execute("UPDATE patients SET archived = 1");
  EXPECT_EQ(store_.integrity.CountUnusable(), UnusableRecords());
}

/// A folder that is moved away stands for a disk that is unmounted; DaemonDiskTest has a real one.
TEST_F(StoreIntegrityTest, AnotherFolderInPlaceOfTheScansIsNoticedAndTheSameOneTakenBack) {
  EXPECT_EQ(store_.WhyOtherScans().English(), "");
  EXPECT_NO_THROW(store_.CheckWritable());
  const fs::path scans = store_.folders.scans(), away = folder_ / "away";
  fs::rename(scans, away);
  EXPECT_THAT(store_.WhyOtherScans().English(), HasSubstr(scans.string()));
  fs::create_directory(scans);  // what a disk was mounted on
  EXPECT_THAT(testing::MessageOf<DiskRefused>([&] { store_.CheckWritable(); }),
              HasSubstr("not the one that was opened"));
  fs::remove(scans);
  fs::rename(away, scans);
  EXPECT_EQ(store_.WhyOtherScans().English(), "");
  fs::copy(scans, away, fs::copy_options::recursive);  // the disk under another number
  fs::remove_all(scans);
  fs::rename(away, scans);
  EXPECT_EQ(store_.WhyOtherScans().English(), "") << "known by its newest scan";
  EXPECT_NO_THROW(store_.CheckWritable());
}

}  // namespace
}  // namespace plumb
