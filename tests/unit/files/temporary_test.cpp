// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/temporary.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>

#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

mode_t ModeOf(const fs::path& path) {
  struct stat status {};
  EXPECT_EQ(::stat(path.c_str(), &status), 0);
  return status.st_mode & 07777;
}

TEST(TemporaryTest, AFolderIsPrivateAndIsRemovedWithItsContents) {
  const testing::TempFolder parent;
  fs::path first;
  {
    const TemporaryFolder folder(parent.path(), "work-"), other(parent.path(), "work-");
    first = folder.path();
    EXPECT_NE(first, other.path());
    EXPECT_EQ(first.parent_path(), parent.path());
    EXPECT_EQ(first.filename().string().rfind("work-", 0), 0U);
    EXPECT_EQ(ModeOf(first), 0700U);
    fs::create_directory(first / "inner");
    WriteWholeFile(first / "inner" / "file", "text");
  }
  EXPECT_FALSE(fs::exists(first));
  EXPECT_THROW(TemporaryFolder(parent / "missing", "work-"), IoError);
}

TEST(TemporaryTest, AFileHasANameOfItsOwnWithItsExtension) {
  const testing::TempFolder folder;
  const UniqueFile a = MakeUniqueFile(folder.path(), "report-", ".txt");
  const UniqueFile b = MakeUniqueFile(folder.path(), "report-", ".txt");
  EXPECT_NE(a.path, b.path);
  EXPECT_EQ(a.path.extension(), ".txt");
  EXPECT_EQ(ModeOf(a.path), 0600U);
  EXPECT_EQ(::write(a.descriptor, "text", 4), 4);
  EXPECT_EQ(fs::file_size(a.path), 4U);
  ::close(a.descriptor);
  ::close(b.descriptor);
  EXPECT_THROW((void)MakeUniqueFile(folder / "missing", "report-"), IoError);
}

}  // namespace
}  // namespace plumb
