// SPDX-License-Identifier: Apache-2.0
// The restore of an encrypted backup is rehearsed before it appears.
#include <fcntl.h>
#include <stdlib.h>

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "daemon/archive/backup.hpp"
#include "daemon/archive/rehearsal.hpp"
#include "daemon/archive/tar_file.hpp"
#include "daemon/database/database_errors.hpp"
#include "tests/support/full_disk.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/archive/age_keys.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::MessageOf;

class RehearsalTest : public ::testing::Test {
 protected:
  RehearsalTest() {
    Store store(state());
    const std::string patient = store.patients.Add(testing::kAnna, "P", "thorax");
    for (int i = 0; i < 2; ++i) (void)testing::StoreScan(store, patient);
  }
  ~RehearsalTest() override { ::setenv("PATH", path_.c_str(), 1); }
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  [[nodiscard]] fs::path archive() const { return folder_ / "plumb.tar"; }
  [[nodiscard]] fs::path scratch() const { return folder_ / "scratch"; }

  void Rehearse(const fs::path& tar) const {
    fs::remove_all(scratch());
    fs::create_directory(scratch());
    const Descriptor input(::open(tar.c_str(), O_RDONLY | O_CLOEXEC));
    RehearseRestore(input.get(), scratch(), {});
  }
  [[nodiscard]] std::string WhyNot(const std::string& bytes) const {
    const fs::path changed = folder_ / "changed.tar";
    fs::remove(changed);
    WriteWholeFile(changed, std::string_view(bytes));
    return MessageOf<DataError>([&] { Rehearse(changed); });
  }
  /// A program `plumb` along PATH that does this with the stream.
  void PlumbDoes(const std::string& script) const {
    const fs::path program = folder_ / "bin" / "plumb";
    fs::create_directories(program.parent_path());
    fs::remove(program);
    WriteWholeFile(program, std::string_view("#!/bin/sh\n" + script + "\n"));
    fs::permissions(program, fs::perms::owner_all);
    ::setenv("PATH", (program.parent_path().string() + ":" + path_).c_str(), 1);
  }
  [[nodiscard]] BackupReport BackUp() const {
    return BackUpStopped(state(), folder_ / "disk" / "plumb", {},
                         AgeRecipients({testing::kRecipient}));
  }

  testing::TempFolder folder_;
  std::string path_ = ::getenv("PATH");
};

TEST_F(RehearsalTest, UnpacksAndOpensWhatWouldBeRestored) {
  (void)BackUpStopped(state(), archive());
  Rehearse(archive());
  Store opened(scratch());
  EXPECT_EQ(opened.scans.List("1", 9).size(), 2U);
  EXPECT_EQ(opened.recovery().lost_scans, 0);
}

TEST_F(RehearsalTest, NothingDamagedPasses) {
  (void)BackUpStopped(state(), archive());
  const std::string whole = ReadTextFile(archive(), 1U << 26U);
  for (const char* text : {"SQLite format", "scene.json of", "scene/cloud.ply of"}) {
    std::string flipped = whole;
    flipped[flipped.find(text)] ^= 1;
    EXPECT_THAT(WhyNot(flipped), HasSubstr("SHA256SUMS")) << text;
  }
  for (std::size_t part = 1; part < 8; ++part)
    EXPECT_NE(WhyNot(whole.substr(0, whole.size() / 8 * part)), "") << part;
  EXPECT_NE(WhyNot(""), "");
}

/// The sums are right, but the files of the scans are not in it.
TEST_F(RehearsalTest, AFileThatTheDatabaseListsMustBeThere) {
  {
    TarWriter tar(folder_ / "without.tar");
    const std::string sums = tar.Add(state(), kDatabaseFile, {}).digest.sha256 + "  plumb.db\n";
    tar.AddText("SHA256SUMS", sums);
    tar.AddText("backup.json", nlohmann::json{{"sha256sums", Sha256Of(sums)}}.dump());
    tar.Close();
  }
  EXPECT_THAT(MessageOf<DataError>([&] { Rehearse(folder_ / "without.tar"); }),
              HasSubstr("is missing"));
}

TEST_F(RehearsalTest, OnAFullDiskItIsNoFaultOfTheBackup) {
  (void)BackUpStopped(state(), archive());
  EXPECT_EQ(testing::WriteOnFullDisk(10'000, [&] { Rehearse(archive()); }),
            testing::WriteOutcome::kIoError);
}

TEST_F(RehearsalTest, ABackupThatCannotBeRestoredDoesNotReplaceTheOneBefore) {
  PlumbDoes("cat > /dev/null");
  const BackupReport first = BackUp();
  EXPECT_TRUE(first.unrehearsed.empty()) << first.unrehearsed.English();
  const std::string before = ReadTextFile(first.target, 1U << 26U);
  PlumbDoes("head -c 1000 > /dev/null; echo 'page 7 is not as it was written' >&2; exit 3");
  EXPECT_THAT(MessageOf<DataError>([&] { (void)BackUp(); }), HasSubstr("page 7"));
  EXPECT_EQ(ReadTextFile(first.target, 1U << 26U), before);
  EXPECT_FALSE(fs::exists(state() / ".rehearsal"));
}

TEST_F(RehearsalTest, WithoutARehearsalTheBackupSaysSo) {
  PlumbDoes("cat > /dev/null; echo 'no room' >&2; exit 1");
  const BackupReport made = BackUp();
  EXPECT_EQ(made.unrehearsed.English(), "no room");
  EXPECT_TRUE(fs::exists(made.target));
  PlumbDoes("kill -9 $$");
  EXPECT_FALSE(BackUp().unrehearsed.empty());
}

TEST_F(RehearsalTest, WhatACutOffBackupLeftIsGoneAtTheNextStart) {
  for (const char* name : {".backup", ".rehearsal"}) fs::create_directory(state() / name);
  const Store store(state());
  for (const char* name : {".backup", ".rehearsal"}) EXPECT_FALSE(fs::exists(state() / name));
}

}  // namespace
}  // namespace plumb
