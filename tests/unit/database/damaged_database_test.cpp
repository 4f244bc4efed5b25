// SPDX-License-Identifier: Apache-2.0
// What a disk does to a database and its log of writes is refused or has no effect on any row.
#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <map>
#include <random>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/database/audit_chain.hpp"
#include "daemon/database/database.hpp"
#include "daemon/database/schema.hpp"
#include "daemon/database/sealed_pages.hpp"
#include "daemon/database/stored_values.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/database/rows_of.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::MessageOf;
using testing::RowsOf;

constexpr std::size_t kLongest = std::size_t{1} << 26U;

/// The files of a database by the end of their names: "", "-wal", "-mark", "-seals".
using Files = std::map<std::string, std::string>;

Files FilesOf(const fs::path& folder) {
  Files files;
  for (const char* end : {"", "-wal", "-mark", "-seals"}) {
    const fs::path file = folder / (std::string(kDatabaseFile) + end);
    if (fs::exists(file)) files[end] = ReadTextFile(file, kLongest);
  }
  return files;
}

void Place(const fs::path& folder, const Files& files) {
  fs::remove_all(folder);
  fs::create_directories(folder);
  for (const auto& [end, bytes] : files) WriteWholeFile(folder / (kDatabaseFile + end), bytes);
}

/// One change, as a service of the store makes it.
void Change(Database& database, const std::string& code) {
  Transaction transaction(database);
  database.Run("INSERT INTO patients (code, site, created_at) VALUES (?, 'thorax', 1)", code);
  database.Run("INSERT OR REPLACE INTO settings (name, value) VALUES ('settings', ?)",
               code + std::string(3000, 's'));
  AppendAuditEntry(database, kSelf, "patient.add", code, Message::Verbatim(std::string(200, 'a')));
  transaction.Commit();
}

constexpr const char* kSettings = "SELECT value FROM settings WHERE name = 'settings'";

/// In place, as a disk does it.
void Overwrite(const fs::path& file, const std::string& bytes) {
  const int fd = ::open(file.c_str(), O_WRONLY | O_CLOEXEC);
  ASSERT_EQ(::pwrite(fd, bytes.data(), bytes.size(), 0), static_cast<ssize_t>(bytes.size()));
  ::close(fd);
}

enum class Outcome { kSame, kRefused, kSilent };

class DamagedDatabaseTest : public ::testing::Test {
 protected:
  DamagedDatabaseTest() {
    fs::create_directories(folder_ / "state");
    const fs::path file = folder_ / "state" / kDatabaseFile;
    {
      Database database(file, Database::Access::kReadWrite);
      Migrate(database);
      for (int i = 0; i < 30; ++i) Change(database, fmt::format("D0-{}", i));
    }
    {
      Database database(file, Database::Access::kReadWrite);
      rows_[0] = RowsOf(database);
    }
    days_[0] = FilesOf(folder_ / "state");
    Database database(file, Database::Access::kReadWrite);
    for (int day = 1; day < 4; ++day) {
      for (int i = 0; i < 8; ++i) Change(database, fmt::format("D{}-{}", day, i));
      rows_[day] = RowsOf(database);
      days_[day] = FilesOf(folder_ / "state");  // as a power cut leaves it
      if (day == 2) (void)database.Checkpoint();
    }
  }

  /// @param expected  The rows that there must be if the database is opened.
  Outcome Try(const Files& files, const std::string& expected) {
    const fs::path folder = folder_ / "damaged";
    Place(folder, files);
    try {
      Database database(folder / kDatabaseFile, Database::Access::kReadWrite);
      database.CheckIntegrity();
      return RowsOf(database) == expected ? Outcome::kSame : Outcome::kSilent;
    } catch (const DatabaseCorrupt&) {
      // Nothing is overwritten by the refusal itself.
      if (const auto wal = files.find("-wal"); wal != files.end() && !wal->second.empty()) {
        EXPECT_EQ(FilesOf(folder).count("-wal"), 1U);
      }
      return Outcome::kRefused;
    } catch (const IoError&) {
      return Outcome::kRefused;
    }
  }

  static int Rounds() {
    constexpr int kSample = 70;
    const char* const repeats = std::getenv("PLUMB_FAULT_REPEATS");
    return kSample * (repeats == nullptr ? 1 : std::max(1, std::atoi(repeats)));
  }

  /// Flips one bit of the file in each round, and requires that no row changes.
  void FlipBits(int day, const std::string& end, unsigned seed, bool is_refused = true) {
    std::mt19937 random(seed);
    std::map<Outcome, int> num;
    for (int round = 0; round < Rounds(); ++round) {
      Files files = days_.at(day);
      std::string& bytes = files.at(end);
      const std::size_t at = random() % bytes.size();
      bytes[at] = static_cast<char>(bytes[at] ^ (1 << random() % 8));
      const Outcome outcome = Try(files, rows_.at(day));
      ++num[outcome];
      EXPECT_NE(outcome, Outcome::kSilent) << "byte " << at;
    }
    std::cout << fmt::format("plumb.db{}: {} flips, {} without effect, {} refused, {} silent\n",
                             end, Rounds(), num[Outcome::kSame], num[Outcome::kRefused],
                             num[Outcome::kSilent]);
    EXPECT_EQ(num[Outcome::kRefused] > 0, is_refused);
  }

  testing::TempFolder folder_;
  std::map<int, Files> days_;
  std::map<int, std::string> rows_;
};

TEST_F(DamagedDatabaseTest, WholeDaysAreOpened) {
  ASSERT_GT(days_.at(2).at("-wal").size(), 20000U) << "most of it is in the log";
  for (int day = 0; day < 4; ++day) EXPECT_EQ(Try(days_.at(day), rows_.at(day)), Outcome::kSame);
}

TEST_F(DamagedDatabaseTest, NoFlippedBitOfAClosedDatabaseChangesARow) { FlipBits(0, "", 11); }
TEST_F(DamagedDatabaseTest, NoFlippedBitBelowALogChangesARow) { FlipBits(3, "", 12); }
TEST_F(DamagedDatabaseTest, NoFlippedBitOfTheLogLosesARow) { FlipBits(2, "-wal", 13); }

/// After a power cut the mark may be of an earlier change: then only the log itself can tell.
TEST_F(DamagedDatabaseTest, ADamagedLogIsRefusedWithoutTheMark) {
  Files files = days_.at(2);
  files.erase("-mark");
  files.at("-wal")[files.at("-wal").size() / 3] ^= 1;
  EXPECT_EQ(Try(files, rows_.at(2)), Outcome::kRefused);
  files = days_.at(2);
  files.at("-mark")[1] ^= 1;
  EXPECT_EQ(Try(files, rows_.at(2)), Outcome::kSame) << "a damaged mark says nothing";
}

TEST_F(DamagedDatabaseTest, NothingConfirmedIsCutOff) {
  std::mt19937 random(14);
  std::map<Outcome, int> num;
  for (int round = 0; round < Rounds() / 4; ++round) {
    for (const char* end : {"", "-wal"}) {
      Files files = days_.at(2);
      files.at(end).resize(random() % files.at(end).size());
      const Outcome outcome = Try(files, rows_.at(2));
      ++num[outcome];
      EXPECT_NE(outcome, Outcome::kSilent) << end << files.at(end).size();
    }
  }
  // The log may end with frames of an earlier one, which nobody misses.
  EXPECT_GT(num[Outcome::kRefused], 9 * num[Outcome::kSame]);
  Files files = days_.at(2);
  files.erase("-wal");
  EXPECT_EQ(Try(files, rows_.at(2)), Outcome::kRefused) << "a missing log";
  files = days_.at(2);
  files.erase("");
  EXPECT_EQ(Try(files, rows_.at(2)), Outcome::kRefused) << "a missing database";
}

/// An unfinished change at the end of the log does not count: it was never confirmed to anybody.
TEST_F(DamagedDatabaseTest, AnUnconfirmedChangeIsDropped) {
  Files files = days_.at(2);
  std::string& log = files.at("-wal");
  log += log.substr(32, 4120);  // of this log, with a wrong sum
  log[log.size() - 4120 + 7] = 0;
  log[log.size() - 4120 + 6] = 0;  // and without a commit mark
  EXPECT_EQ(Try(files, rows_.at(2)), Outcome::kSame);
}

TEST_F(DamagedDatabaseTest, NoMixtureOfTwoDaysIsOpened) {
  for (int base = 0; base < 4; ++base) {
    for (int log = 0; log < 4; ++log) {
      for (int mark = 0; mark < 4; ++mark) {
        Files files = {{"", days_.at(base).at("")},
                       {"-seals", days_.at(base).at("-seals")},
                       {"-mark", days_.at(mark).at("-mark")}};
        if (days_.at(log).count("-wal") != 0) files["-wal"] = days_.at(log).at("-wal");
        // On days 1 and 2 the database file is still that of day 0; on day 3 it is as day 2 ended.
        const int ends = log == 0 && base == 3 ? 2 : log;
        const bool belongs = log == 0 || log == 2 || (log == 1 ? base < 3 : base == 3);
        const bool is_whole = belongs && mark <= ends;
        const Outcome outcome = Try(files, rows_.at(ends));
        EXPECT_EQ(outcome, is_whole ? Outcome::kSame : Outcome::kRefused)
            << "database of day " << base << ", log of " << log << ", mark of " << mark;
      }
    }
  }
}

/// A disk that loses writes leaves pages of an earlier day, each of which is whole.
TEST_F(DamagedDatabaseTest, NoPageOfAnEarlierDayIsRead) {
  std::mt19937 random(15);
  std::map<Outcome, int> num;
  const std::string &older = days_.at(0).at(""), &newer = days_.at(3).at("");
  for (int round = 0; round < Rounds(); ++round) {
    Files files = days_.at(3);
    for (int lost = 0; lost < 1 + round % 3; ++lost) {
      const std::size_t at = random() % (older.size() / kPageBytes) * kPageBytes;
      files.at("").replace(at, kPageBytes, older, at, kPageBytes);
    }
    if (files.at("") == newer) continue;
    const Outcome outcome = Try(files, rows_.at(3));
    ++num[outcome];
    EXPECT_NE(outcome, Outcome::kSilent);
  }
  std::cout << fmt::format(
      "plumb.db: {} times without some writes, {} without effect, {} refused, {} silent\n",
      num[Outcome::kSame] + num[Outcome::kRefused] + num[Outcome::kSilent], num[Outcome::kSame],
      num[Outcome::kRefused], num[Outcome::kSilent]);
  EXPECT_GT(num[Outcome::kRefused], 0);
}

TEST_F(DamagedDatabaseTest, TheListOfSealsIsComparedAndProvesNothingWhenItIsDamaged) {
  FlipBits(3, "-seals", 16, /*is_refused=*/false);
  Files files = days_.at(3);
  files.at("-seals") = days_.at(0).at("-seals");
  EXPECT_EQ(Try(files, rows_.at(3)), Outcome::kRefused) << "of an earlier day";
  files.at("-seals").clear();
  EXPECT_EQ(Try(files, rows_.at(3)), Outcome::kSame);
  files.erase("-seals");
  ASSERT_EQ(Try(files, rows_.at(3)), Outcome::kSame) << "it is made anew";
  EXPECT_TRUE(fs::exists(folder_ / "damaged" / "plumb.db-seals"));
}

/// SQLite would put the pages of a journal into the database before it looks into its log.
TEST_F(DamagedDatabaseTest, AJournalOfAnotherTimeIsNotRolledBack) {
  constexpr std::uint32_t kNonce = 7, kStep = 200, kSector = 512;
  const auto number = [](std::uint32_t value) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift);
    return bytes;
  };
  const std::string& older = days_.at(0).at("");
  const auto num_pages = static_cast<std::uint32_t>(older.size() / kPageBytes);
  std::string journal("\xd9\xd5\x05\xf9\x20\xa1\x63\xd7", 8);
  for (const std::uint32_t value : {num_pages, kNonce, num_pages, kSector, 4096U})
    journal += number(value);
  journal.resize(kSector);
  for (std::uint32_t page = 0; page < num_pages; ++page) {
    const std::string bytes = older.substr(page * kPageBytes, kPageBytes);
    std::uint32_t sum = kNonce;
    for (std::size_t at = kPageBytes - kStep; at > 0 && at < kPageBytes; at -= kStep)
      sum += static_cast<std::uint8_t>(bytes[at]);
    journal += number(page + 1) + bytes + number(sum);
  }
  Files files = days_.at(3);
  files["-journal"] = journal;
  EXPECT_EQ(Try(files, rows_.at(3)), Outcome::kRefused);
  files.erase("-mark");
  EXPECT_EQ(Try(files, rows_.at(3)), Outcome::kRefused);
  files.at("-journal").clear();
  EXPECT_EQ(Try(files, rows_.at(3)), Outcome::kSame);
}

/// The index of the log is in the memory of the process, never in a file.
TEST_F(DamagedDatabaseTest, AFileOfSharedMemoryIsNotRead) {
  std::mt19937 random(17);
  for (int round = 0; round < Rounds() / 4; ++round) {
    Files files = days_.at(2);
    std::string& bytes = files["-shm"];
    bytes.resize(32768);
    for (char& byte : bytes) byte = static_cast<char>(random());
    EXPECT_EQ(Try(files, rows_.at(2)), Outcome::kSame);
  }
}

/// A page of the log that goes bad while the database is open, before anything has read it.
TEST_F(DamagedDatabaseTest, ALoggedPageThatChangesLaterIsRefusedWhenItIsRead) {
  const fs::path file = folder_ / "damaged" / kDatabaseFile;
  Place(file.parent_path(), days_.at(2));
  Database database(file, Database::Access::kReadWrite);
  std::string log = days_.at(2).at("-wal");
  for (std::size_t at = log.find("D2-7sss"); at != std::string::npos; at = log.find("D2-7sss", at))
    log[at + 3] ^= 1;
  Overwrite(file.string() + "-wal", log);
  EXPECT_THAT(MessageOf<DatabaseCorrupt>([&] { (void)database.FirstText(kSettings); }),
              HasSubstr("log of writes"));
  EXPECT_FALSE(database.Checkpoint()) << "the page does not get into the database";
}

/// The loop reads rows: what this process has read or written is not read again, so that it waits
/// for no disk, and later damage does not reach it. Checks read the disk.
TEST_F(DamagedDatabaseTest, RowsComeFromTheMemoryAndChecksFromTheDisk) {
  const fs::path file = folder_ / "damaged" / kDatabaseFile;
  Place(file.parent_path(), days_.at(0));
  Database database(file, Database::Access::kReadWrite);
  Database reader(file, Database::Access::kReadOnly);
  const std::string rows = RowsOf(database);
  Change(database, "D9-9");
  Overwrite(file.string() + "-wal", std::string(fs::file_size(file.string() + "-wal"), 'x'));
  EXPECT_THAT(reader.FirstText(kSettings).value_or(""), ::testing::StartsWith("D9-9s"));
  ASSERT_TRUE(database.Checkpoint()) << "as it was written, and not as the log now has it";
  Overwrite(file, std::string(fs::file_size(file), 'x'));
  EXPECT_THAT(reader.FirstText(kSettings).value_or(""), ::testing::StartsWith("D9-9s"));
  EXPECT_NE(RowsOf(reader), rows);
  EXPECT_THROW((Database(file, Database::Access::kFromDisk).CheckIntegrity()), DatabaseCorrupt);
}

/// Of 0.2.0: a plain file, written by SQLite itself, here with changes in its log.
TEST_F(DamagedDatabaseTest, ADatabaseWithoutChecksumsIsConvertedOnce) {
  const fs::path folder = folder_ / "plain", file = folder / kDatabaseFile;
  fs::create_directories(folder);
  sqlite3* plain = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &plain), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(plain,
                         "PRAGMA journal_mode = WAL; CREATE TABLE t (a INTEGER PRIMARY KEY, b); "
                         "INSERT INTO t VALUES (5, 'five'), (9, 'nine'); PRAGMA user_version = 9",
                         nullptr, nullptr, nullptr),
            SQLITE_OK);
  for (const char* end : {"", "-wal"})
    fs::copy_file(file.string() + end, folder_ / (std::string("copy") + end));
  sqlite3_close(plain);
  for (const char* end : {"", "-wal"})
    fs::copy_file(folder_ / (std::string("copy") + end), file.string() + end,
                  fs::copy_options::overwrite_existing);
  std::string rows;
  {
    Database kept(file, Database::Access::kUnsealed);
    rows = RowsOf(kept);
  }
  {
    Database database(file, Database::Access::kReadWrite);
    EXPECT_EQ(RowsOf(database), rows);
    EXPECT_EQ(database.FirstInteger("PRAGMA user_version"), 9);
  }
  EXPECT_EQ(ReadTextFile(file, kLongest).at(20), 8) << "reserved bytes";
  Database kept(folder / kBeforeChecksums / kDatabaseFile, Database::Access::kFrozen);
  EXPECT_EQ(RowsOf(kept), rows);
  Files files = FilesOf(folder);
  ASSERT_EQ(Try(files, rows), Outcome::kSame);
  files.at("")[files.at("").find("five")] ^= 1;
  EXPECT_EQ(Try(files, rows), Outcome::kRefused);
}

/// The note that pages have checksums is a byte of the first page.
TEST_F(DamagedDatabaseTest, ChecksumsCannotBeSwitchedOff) {
  Files files = days_.at(0);
  files.at("")[20] = 0;
  EXPECT_EQ(Try(files, rows_.at(0)), Outcome::kRefused);
  files.erase("-mark");
  EXPECT_EQ(Try(files, rows_.at(0)), Outcome::kRefused);
}

TEST_F(DamagedDatabaseTest, ACopyCarriesChecksumsToo) {
  const fs::path copy = folder_ / "copy.db";
  Database(folder_ / "state" / kDatabaseFile, Database::Access::kReadOnly).CopyTo(copy);
  Place(folder_ / "damaged", {{"", ReadTextFile(copy, kLongest)}});
  EXPECT_EQ(Try({{"", ReadTextFile(copy, kLongest)}}, rows_.at(3)), Outcome::kSame);
  std::string bytes = ReadTextFile(copy, kLongest);
  bytes[bytes.find("D0-7")] ^= 1;
  EXPECT_EQ(Try({{"", bytes}}, rows_.at(3)), Outcome::kRefused);
}

TEST_F(DamagedDatabaseTest, ACopyOfADamagedDatabaseNamesThePageAndNotTheDiskOfTheCopy) {
  std::string bytes = days_.at(0).at("");
  const std::size_t at = bytes.rfind("sssss");
  ASSERT_NE(at, std::string::npos);
  bytes[at] ^= 1;
  Place(folder_ / "damaged", {{"", bytes}, {"-mark", days_.at(0).at("-mark")}});
  Database database(folder_ / "damaged" / kDatabaseFile, Database::Access::kReadOnly);
  EXPECT_THAT(MessageOf<DatabaseCorrupt>([&] { database.CopyTo(folder_ / "copy.db"); }),
              AllOf(HasSubstr("page "), HasSubstr("is not as it was written")));
}

}  // namespace
}  // namespace plumb
