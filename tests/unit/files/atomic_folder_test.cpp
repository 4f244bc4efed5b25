// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/atomic_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cerrno>
#include <chrono>
#include <fstream>
#include <set>
#include <string>
#include <utility>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/full_disk.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::MessageOf;
using testing::TempFolder;
using testing::WriteOnFullDisk;
using testing::WriteOutcome;

OutputKind Kind() { return {Message::Verbatim("thing"), "thing.json", {"thing.json", "data"}}; }

std::set<std::string> Names(const fs::path& folder) {
  std::set<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    names.insert(entry.path().filename().string());
  return names;
}

void WriteThing(const fs::path& target, const std::string& content) {
  AtomicFolder output(target, Kind());
  WriteWholeFile(output.path() / "thing.json", content);
  output.Commit();
}

TEST(AtomicFolderTest, WhereNoFolderCanBeMadeTheReasonIsTold) {
  // Nobody makes folders there, root neither.
  EXPECT_THAT(
      MessageOf<IoError>([] { WriteThing("/sys/plumb-out", "1"); }),
      AllOf(HasSubstr("/sys/plumb-out"), HasSubstr("choose a folder that you may write to")));
}

TEST(AtomicFolderTest, AppearsOnlyWithCommit) {
  const TempFolder folder;
  {
    AtomicFolder output(folder / "out", Kind());
    WriteWholeFile(output.path() / "thing.json", std::string_view("1"));
    EXPECT_FALSE(fs::exists(folder / "out"));
    EXPECT_EQ(output.path().filename().string().front(), '.');
    output.Commit();
  }
  EXPECT_THAT(Names(folder.path()), ElementsAre("out"));
  EXPECT_EQ(ReadTextFile(folder / "out/thing.json", 10), "1");
  // As mkdir makes it, not private to this process.
  struct stat made {};
  struct stat expected {};
  ::mkdir((folder / "plain").c_str(), 0777);
  ::stat((folder / "out").c_str(), &made);
  ::stat((folder / "plain").c_str(), &expected);
  EXPECT_EQ(made.st_mode, expected.st_mode);
}

TEST(AtomicFolderTest, AnErrorLeavesNothingNotEvenNewParents) {
  const TempFolder folder;
  try {
    AtomicFolder output(folder / "new/parents/out", Kind());
    WriteWholeFile(output.path() / "thing.json", std::string_view("1"));
    throw std::runtime_error("the work failed");
  } catch (const std::runtime_error&) {
  }
  EXPECT_THAT(Names(folder.path()), IsEmpty());
}

TEST(AtomicFolderTest, MakesParentsAndAcceptsTrailingSlashes) {
  const TempFolder folder;
  WriteThing(folder.path().string() + "/new/parents/out/", "1");
  EXPECT_EQ(ReadTextFile(folder / "new/parents/out/thing.json", 10), "1");
}

TEST(AtomicFolderTest, ReplacesOneOfItsKindAndKeepsItOnError) {
  const TempFolder folder;
  WriteThing(folder / "out", "old");
  WriteWholeFile(folder / "out/data", std::string_view("goes with the old one"));
  {
    AtomicFolder output(folder / "out", Kind());
    WriteWholeFile(output.path() / "thing.json", std::string_view("half"));
  }
  EXPECT_EQ(ReadTextFile(folder / "out/thing.json", 10), "old");
  WriteThing(folder / "out", "new");
  EXPECT_THAT(Names(folder / "out"), ElementsAre("thing.json"));
  EXPECT_EQ(ReadTextFile(folder / "out/thing.json", 10), "new");
  EXPECT_THAT(Names(folder.path()), ElementsAre("out"));
}

TEST(AtomicFolderTest, TakesAnEmptyFolder) {
  const TempFolder folder;
  fs::create_directory(folder / "out");
  WriteThing(folder / "out", "1");
  EXPECT_THAT(Names(folder / "out"), ElementsAre("thing.json"));
}

TEST(AtomicFolderTest, FollowsALinkToAFolder) {
  const TempFolder folder;
  fs::create_directory(folder / "real");
  fs::create_directory_symlink("real", folder / "link");
  WriteThing(folder / "link", "1");
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_THAT(Names(folder / "real"), ElementsAre("thing.json"));
}

TEST(AtomicFolderTest, RefusesWhatIsNotItsOwn) {
  const TempFolder folder;
  WriteThing(folder / "out", "1");
  WriteWholeFile(folder / "out/notes.txt", std::string_view("somebody's work"));
  EXPECT_THAT(MessageOf<IoError>([&] { AtomicFolder(folder / "out", Kind()); }),
              AllOf(HasSubstr("notes.txt"), HasSubstr("not part of a thing"), HasSubstr("choose")));
  EXPECT_EQ(ReadTextFile(folder / "out/notes.txt", 100), "somebody's work");

  fs::create_directory(folder / "other");
  WriteWholeFile(folder / "other/data", std::string_view());
  EXPECT_THAT(MessageOf<IoError>([&] { AtomicFolder(folder / "other", Kind()); }),
              HasSubstr("holds no thing.json"));

  WriteWholeFile(folder / "file", std::string_view("1"));
  EXPECT_THAT(MessageOf<IoError>([&] { AtomicFolder(folder / "file", Kind()); }),
              HasSubstr("there is a file of that name"));
  EXPECT_THAT(Names(folder.path()), ElementsAre("file", "other", "out"));
}

TEST(AtomicFolderTest, RefusesWhatBecameForeignMeanwhile) {
  const TempFolder folder;
  {
    AtomicFolder output(folder / "out", Kind());
    WriteWholeFile(output.path() / "thing.json", std::string_view("1"));
    fs::create_directory(folder / "out");
    WriteWholeFile(folder / "out/notes.txt", std::string_view("just saved"));
    EXPECT_THROW(output.Commit(), IoError);
  }
  EXPECT_THAT(Names(folder.path()), ElementsAre("out"));
  EXPECT_THAT(Names(folder / "out"), ElementsAre("notes.txt"));
}

TEST(AtomicFolderTest, ClearsWhatAKilledProcessLeftButNothingInUse) {
  const TempFolder folder;
  const auto age = [](const fs::path& path) {
    fs::last_write_time(path, fs::file_time_type::clock::now() - std::chrono::hours(1));
  };
  fs::create_directory(folder / ".out.plumb-1-0");
  WriteWholeFile(folder / ".out.plumb-1-0/thing.json", std::string_view("half"));
  age(folder / ".out.plumb-1-0");
  const AtomicFolder in_use(folder / "out", Kind());
  age(in_use.path());
  WriteThing(folder / "out", "1");
  EXPECT_THAT(Names(folder.path()),
              ::testing::UnorderedElementsAre("out", in_use.path().filename().string()));
}

TEST(AtomicFolderTest, TheDisksRefusalIsAnIoErrorThatSaysWhatToDo) {
  EXPECT_THAT(MessageOf<IoError>([] { AtomicFolder("/proc/plumb/out", Kind()); }),
              HasSubstr("/proc/plumb/out"));
  for (const auto& [error, why] : {std::pair(ENOSPC, "No space left"), {EDQUOT, "quota exceeded"}})
    EXPECT_THAT(DescribeWriteError("a/b", error).English(),
                AllOf(HasSubstr("cannot write a/b"), HasSubstr(why), HasSubstr("free space")));
}

TEST(AtomicFolderTest, ADiskThatFillsUpLeavesNothing) {
  const TempFolder folder;
  WriteThing(folder / "out", "old");
  EXPECT_EQ(WriteOnFullDisk(1'000'000,
                            [&] {
                              AtomicFolder output(folder / "out", Kind());
                              WriteWholeFile(output.path() / "data",
                                             std::vector<std::uint8_t>(3'000'000, 7));
                              output.Commit();
                            }),
            WriteOutcome::kIoError);
  EXPECT_THAT(Names(folder.path()), ElementsAre("out"));
  EXPECT_EQ(ReadTextFile(folder / "out/thing.json", 10), "old");
}

TEST(AtomicFileTest, AppearsWholeOrNotAtAll) {
  const TempFolder folder;
  WriteFileAtomically(folder / "a.txt",
                      [](const fs::path& path) { WriteWholeFile(path, std::string_view("1")); });
  EXPECT_EQ(ReadTextFile(folder / "a.txt", 10), "1");
  EXPECT_THROW(WriteFileAtomically(folder / "a.txt",
                                   [](const fs::path& path) {
                                     WriteWholeFile(path, std::string_view("half"));
                                     throw IoError("disk full");
                                   }),
               IoError);
  EXPECT_EQ(ReadTextFile(folder / "a.txt", 10), "1");
  EXPECT_THAT(Names(folder.path()), ElementsAre("a.txt"));
  EXPECT_THAT(
      MessageOf<IoError>([&] { WriteFileAtomically(folder.path(), [](const fs::path&) {}); }),
      HasSubstr("is a folder"));
  EXPECT_THROW(WriteFileAtomically(
                   folder / "none/a.txt",
                   [](const fs::path& path) { WriteWholeFile(path, std::string_view("1")); }),
               IoError);
}

TEST(FileWriterTest, AFullDiskIsNamedAndADeviceIsLeftAlone) {
  const TempFolder folder;
  fs::create_symlink("/dev/full", folder / "full");
  EXPECT_THAT(MessageOf<IoError>([&] { WriteWholeFile(folder / "full", std::string_view("x")); }),
              AllOf(HasSubstr("No space left"), HasSubstr("free space")));
  EXPECT_TRUE(fs::is_symlink(folder / "full"));
}

TEST(FileWriterTest, AWriterLeftEarlyRemovesItsFile) {
  const TempFolder folder;
  {
    FileWriter file(folder / "half");
    file.Write(std::vector<std::uint8_t>(1'000'000, 1));
  }
  EXPECT_FALSE(fs::exists(folder / "half"));
  FileWriter file(folder / "whole");
  file.Write(std::string_view("abc"));
  file.Write(std::vector<std::uint8_t>(300'000, 'x'));
  file.Write(std::string_view("def"));
  file.Close();
  EXPECT_EQ(ReadTextFile(folder / "whole", 1 << 20), "abc" + std::string(300'000, 'x') + "def");
}

}  // namespace
}  // namespace plumb
