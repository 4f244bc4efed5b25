// SPDX-License-Identifier: Apache-2.0
#include "daemon/update/usb_sticks.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <future>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "drivers/files/file_io.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

class UsbSticksTest : public ::testing::Test {
 protected:
  void Put(const char* path, const std::string& text = "x") {
    fs::create_directories((folder_ / path).parent_path());
    WriteWholeFile(folder_ / path, text);
  }
  testing::TempFolder folder_;
  const UsbSticks sticks_{folder_.path()};
};

TEST_F(UsbSticksTest, WithoutAStickNothingIsOffered) {
  EXPECT_THAT(sticks_.Bundles(), IsEmpty());
  EXPECT_THAT(UsbSticks(folder_ / "none").Bundles(), IsEmpty());
  EXPECT_EQ(sticks_.Open("v2.raucb"), -1);
}

TEST_F(UsbSticksTest, BundlesOfAllSticksAreOfferedAndNothingElse) {
  for (const char* path :
       {"sdb1/v3.raucb", "sda1/v2.raucb", "sda1/v3.raucb", "sda1/.hidden.raucb", "sda1/photo.jpg",
        "sda1/a b.raucb", "sda1/-x.raucb", "sda1/folder/v9.raucb", "v8.raucb"})
    Put(path);
  fs::create_directory(folder_ / "sda1" / "v7.raucb");
  fs::create_symlink("/etc/shadow", folder_ / "sda1" / "v6.raucb");
  ASSERT_EQ(::mkfifo((folder_ / "sda1" / "v5.raucb").c_str(), 0600), 0);
  EXPECT_THAT(sticks_.Bundles(), ElementsAre("v2.raucb", "v3.raucb"));
  for (const char* name :
       {"v5.raucb", "v6.raucb", "v7.raucb", "v8.raucb", "photo.jpg", "../sda1/v2.raucb", ""})
    EXPECT_EQ(sticks_.Open(name), -1) << name;
}

TEST_F(UsbSticksTest, OneIsReadByItsName) {
  Put("sda1/v2.raucb", "contents");
  const int fd = sticks_.Open("v2.raucb");
  ASSERT_GE(fd, 0);
  char text[16] = {};
  EXPECT_EQ(::read(fd, text, sizeof(text)), 8);
  EXPECT_STREQ(text, "contents");
  ::close(fd);
  fs::remove_all(folder_ / "sda1");
  EXPECT_THAT(sticks_.Bundles(), IsEmpty());
  EXPECT_EQ(sticks_.Open("v2.raucb"), -1);
}

TEST_F(UsbSticksTest, AStickFullOfFilesIsNotLookedThroughForEver) {
  for (int i = 0; i < 40; ++i) Put(("sda1/v" + std::to_string(i) + ".raucb").c_str());
  EXPECT_EQ(sticks_.Bundles().size(), 32U);
}

/// A stick with bad blocks keeps its reader for minutes.
TEST(StickWatchTest, AStickThatHangsHoldsNothingUp) {
  EventLoop loop;
  std::promise<void> hangs;
  std::atomic<int> num_looks = 0;
  int num_changes = 0;
  StickWatch watch(
      loop,
      [&, released = hangs.get_future().share()] {
        ++num_looks;
        released.wait();
        return std::vector<std::string>{"v2.raucb"};
      },
      [&] {
        ++num_changes;
        EXPECT_THAT(watch.Bundles(), ElementsAre("v2.raucb"));
        loop.Quit(0);
      });
  EventLoop::Source timer = loop.MakeTimer("test", [&] {
    for (int i = 0; i < 3; ++i) EXPECT_THAT(watch.Bundles(), IsEmpty());
    hangs.set_value();
  });
  timer.ArmAfter({});
  loop.Run();
  EXPECT_EQ(num_changes, 1);
  EXPECT_GE(num_looks, 1);
  EXPECT_LE(num_looks, 2) << "one after the other, however often it is asked";
}

}  // namespace
}  // namespace plumb
