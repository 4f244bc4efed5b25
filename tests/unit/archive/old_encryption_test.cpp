// SPDX-License-Identifier: Apache-2.0
// Backups and exports that Plumb 0.2.0 has encrypted: they are still read.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "daemon/archive/backup.hpp"
#include "daemon/archive/file_cipher.hpp"
#include "daemon/archive/patient_transfer.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/archive/archive_content.hpp"
#include "tests/unit/archive/old_cipher.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using testing::FilesBelow;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kAnna;
using testing::MessageOf;
using testing::PlanAndApprove;
using testing::StoreScan;

class OldEncryptionTest : public ::testing::Test {
 protected:
  OldEncryptionTest() {
    Store store(state());
    patient_ = store.patients.Add(kAnna, "P", "thorax");
    reference_ = StoreScan(store, patient_);
    (void)PlanAndApprove(store, store.references.Add(kAnna, reference_, "", {}));
    scan_ = StoreScan(store, patient_);
    fs::create_directories(state() / "calibration");
  }
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  [[nodiscard]] fs::path backup() const { return folder_ / "backup"; }
  [[nodiscard]] fs::path restored() const { return folder_ / "restored"; }

  /// As 0.2.0 made it.
  BackupReport BackUp() const {
    const BackupReport report = BackUpStopped(state(), backup());
    testing::SealAsOld(backup(), "backup.json", kKey);
    return report;
  }
  /// Without the database, whose pages a start changes, and the note of a restore.
  static auto FilesOf(const fs::path& folder) { return testing::FilesOfState(folder); }
  /// A key file with this line.
  [[nodiscard]] fs::path KeyFile(const std::string& line, const std::string& name = "key") const {
    const fs::path file = folder_ / name;
    fs::remove(file);
    WriteWholeFile(file, std::string_view(line + "\n"));
    fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write);
    return file;
  }
  [[nodiscard]] std::string WhyNot(const BackupSecret* secret) const {
    return MessageOf<DataError>(
        [&] { (void)RestoreBackup(backup(), restored(), {}, {.secret = secret}); });
  }

  const std::string kKey = "correct horse battery staple";
  testing::TempFolder folder_;
  std::string patient_, reference_, scan_;
};

TEST_F(OldEncryptionTest, WhatIsRestoredIsByteIdenticalAndNothingIsReadableMeanwhile) {
  // More than a piece of the cipher, exactly one, and nothing at all.
  const fs::path scene = state() / "calibration";
  WriteWholeFile(scene / "long.yaml", std::string_view(std::string(200'000, 'p')));
  WriteWholeFile(scene / "piece.yaml", std::string_view(std::string(65536, 'q')));
  WriteWholeFile(scene / "empty.yaml", std::string_view());
  const BackupSecret secret(KeyFile(kKey));
  const BackupReport made = BackUp();
  EXPECT_THAT(made.problems, IsEmpty());
  for (const auto& [name, content] : FilesBelow(backup())) {
    EXPECT_EQ(content.find("scene.json of"), std::string::npos) << name;
    EXPECT_EQ(content.find("SQLite format"), std::string::npos) << name;
    EXPECT_EQ(content.find("pppppppp"), std::string::npos) << name;
  }
  EXPECT_FALSE(fs::exists(state() / ".backup")) << "nor does a copy stay";
  const BackupReport report = RestoreBackup(backup(), restored(), {}, {.secret = &secret});
  EXPECT_EQ(report.bytes, made.bytes);
  EXPECT_EQ(FilesOf(restored()), FilesOf(state()));
  Store store(restored());
  EXPECT_EQ(store.references.Approved(patient_)->scan_id, reference_);
  EXPECT_EQ(store.recovery().lost_scans, 0);
}

TEST_F(OldEncryptionTest, AnotherKeyOrNoneIsSaid) {
  const BackupSecret secret(KeyFile(kKey)), other(KeyFile(kKey + "!", "other"));
  (void)BackUp();
  EXPECT_THAT(WhyNot(&other), HasSubstr("another key"));
  EXPECT_THAT(WhyNot(nullptr), HasSubstr("--key-file"));
  EXPECT_FALSE(fs::exists(restored()));
  (void)BackUpStopped(state(), backup());
  EXPECT_THAT(WhyNot(&secret), HasSubstr("not encrypted"))
      << "a plain one in its place is not taken for it";
}

TEST_F(OldEncryptionTest, AFlippedByteAnywhereRestoresNothing) {
  const BackupSecret secret(KeyFile(kKey));
  (void)BackUp();
  for (const auto& [name, content] : FilesBelow(backup())) {
    if (name.starts_with("scans/") && !name.ends_with("cloud.ply"))
      continue;  // each takes a second
    std::string changed = content;
    changed[name == "backup.json" ? content.find("\"salt\"") + 10 : content.size() / 2] ^= 1;
    WriteWholeFile(backup() / name, std::string_view(changed));
    EXPECT_THAT(WhyNot(&secret), HasSubstr("nothing was restored")) << name;
    EXPECT_FALSE(fs::exists(restored()));
    WriteWholeFile(backup() / name, std::string_view(content));
  }
}

// Who has no key can make the sums fit, but not sign them.
TEST_F(OldEncryptionTest, FilesThatChangedPlacesAreNoticed) {
  const BackupSecret secret(KeyFile(kKey));
  (void)BackUp();
  const auto files = FilesBelow(backup());
  const std::string one = "scans/" + reference_ + "/scene/cloud.ply";
  const std::string two = "scans/" + scan_ + "/scene/cloud.ply";
  WriteWholeFile(backup() / one, std::string_view(files.at(two)));
  WriteWholeFile(backup() / two, std::string_view(files.at(one)));
  std::string sums = files.at("SHA256SUMS");
  for (const std::string& name : {one, two})
    sums.replace(sums.find("  " + name) - 64, 64, DigestOfFile(backup(), name).sha256);
  WriteWholeFile(backup() / "SHA256SUMS", std::string_view(sums));
  std::string about = files.at("backup.json");
  about.replace(about.find("\"sha256sums\": \"") + 15, 64,
                DigestOfFile(backup(), "SHA256SUMS").sha256);
  WriteWholeFile(backup() / "backup.json", std::string_view(about));
  EXPECT_THAT(WhyNot(&secret), HasSubstr("not signed"));
  const FileCipher cipher(secret, nlohmann::ordered_json::parse(about)["encryption"]);
  EXPECT_THAT(MessageOf<DataError>([&] { (void)cipher.Open(backup(), restored(), one, {}); }),
              HasSubstr("not what was encrypted there"))
      << "the place is part of what is sealed";
  fs::create_directories((folder_ / "sealed" / one).parent_path());
  WriteWholeFile(folder_ / "sealed" / one, std::string_view(files.at(one)));
  for (const std::size_t keep :
       {std::size_t{0}, std::size_t{10}, std::size_t{24}, std::size_t{30}}) {
    fs::resize_file(folder_ / "sealed" / one, keep);
    EXPECT_THROW((void)cipher.Open(folder_ / "sealed", restored(), one, {}), DataError) << keep;
  }
}

TEST_F(OldEncryptionTest, AHeaderThatAsksForTooMuchIsRefused) {
  const BackupSecret secret(KeyFile(kKey));
  const nlohmann::ordered_json header = testing::OldCipher(kKey).Header();
  EXPECT_NO_THROW((FileCipher(secret, header)));
  for (const auto& [name, value] : std::vector<std::pair<const char*, nlohmann::ordered_json>>{
           {"memory_bytes", std::uint64_t{1} << 40},
           {"memory_bytes", -1},
           {"operations", 1000000},
           {"operations", "3"},
           {"salt", "zz"},
           {"salt", 7},
           {"algorithm", "rot13"},
           {"key", ""}}) {
    nlohmann::ordered_json bad = header;
    bad[name] = value;
    EXPECT_THROW((FileCipher(secret, bad)), DataError) << name << value;
    bad.erase(name);
    EXPECT_THROW((FileCipher(secret, bad)), DataError) << name;
  }
  EXPECT_THROW((FileCipher(secret, nlohmann::ordered_json(7))), DataError);
}

TEST_F(OldEncryptionTest, AKeyFileHoldsOneLongLineThatNotEverybodyReads) {
  EXPECT_THROW(BackupSecret{KeyFile("fifteen bytes..")}, DataError);
  EXPECT_NO_THROW(BackupSecret{KeyFile("sixteen bytes...")});
  EXPECT_THROW(BackupSecret{KeyFile("two lines of a key\nand the other one")}, DataError);
  EXPECT_THROW(BackupSecret{KeyFile(std::string(2000, 'k'))}, DataError);
  EXPECT_THROW(BackupSecret{folder_ / "nothing"}, DataError);
  const fs::path open = KeyFile(kKey);
  fs::permissions(open, fs::perms::others_read, fs::perm_options::add);
  EXPECT_THAT(MessageOf<DataError>([&] { BackupSecret{open}; }), HasSubstr("everybody"));
}

// Made by the program itself: plumb 0.2.0 export-patient PX-1 ... --key-file KEY.
TEST_F(OldEncryptionTest, AnExportOfTheProgramItselfIsImported) {
  const fs::path file = fs::path(PLUMB_SOURCE_DIR) / "tests/unit/archive/data/patient-0.2.0.tar";
  const BackupSecret secret(KeyFile(kKey)), other(KeyFile(kKey + "!", "other"));
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ImportPatient(file, state()); }),
              HasSubstr("--key-file"));
  EXPECT_THAT(
      MessageOf<DataError>([&] { (void)ImportPatient(file, state(), {}, {.secret = &other}); }),
      HasSubstr("another key"));
  EXPECT_EQ(ImportPatient(file, state(), {}, {.secret = &secret}).code, "PX-1");
  EXPECT_TRUE(Store(state()).patients.FindByCode("PX-1"));
}

TEST_F(OldEncryptionTest, OneFileIsRestoredToo) {
  const BackupReport made = BackUp();
  testing::PackAsOld(backup(), folder_ / "plumb.tar");
  const BackupSecret secret(KeyFile(kKey));
  EXPECT_EQ(VerifyBackup(folder_ / "plumb.tar", {}, {.secret = &secret}).files, made.files);
  EXPECT_EQ(RestoreBackup(folder_ / "plumb.tar", restored(), {}, {.secret = &secret}).bytes,
            made.bytes);
  EXPECT_EQ(FilesOf(restored()), FilesOf(state()));
}

}  // namespace
}  // namespace plumb
