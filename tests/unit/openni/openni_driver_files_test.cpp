// SPDX-License-Identifier: Apache-2.0
// Drivers of other makers, of which the virtual sensor's plug-in takes the place.
#include "drivers/openni/openni_driver.hpp"

#include <dlfcn.h>

#include <cstdlib>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class OpenNiDriverFilesTest : public ::testing::Test {
 protected:
  void Put(const std::string& name) { fs::copy_file(PLUMB_VIRTUAL_DRIVER, folder_.path() / name); }
  [[nodiscard]] OpenNiDriverFile Only() const {
    const auto drivers = FindOpenNiDrivers(folder_.path());
    EXPECT_EQ(drivers.size(), 1U);
    return drivers.empty() ? OpenNiDriverFile{} : drivers.front();
  }
  testing::TempFolder folder_;
};

TEST_F(OpenNiDriverFilesTest, NamesWhatEachDriverServes) {
  Put("libFreenectDriver.so.0");
  Put("libOther.so.0");
  Put("liborbbec.so.0");
  const auto drivers = FindOpenNiDrivers(folder_.path());
  ASSERT_EQ(drivers.size(), 3U);
  EXPECT_EQ(drivers[0].file.filename(), "libFreenectDriver.so.0");
  EXPECT_THAT(drivers[0].serves.English(), HasSubstr("Kinect for Xbox 360"));
  EXPECT_THAT(drivers[1].serves.English(), HasSubstr("does not know"));
  EXPECT_THAT(drivers[2].serves.English(), HasSubstr("Orbbec"));
  for (const OpenNiDriverFile& driver : drivers) {
    EXPECT_FALSE(driver.is_debians);
    EXPECT_THAT(driver.problem.English(), IsEmpty());
  }
}

TEST_F(OpenNiDriverFilesTest, ANameThatOpenNi2PassesOverIsAProblem) {
  Put("liborbbec.so");
  EXPECT_THAT(Only().problem.English(), HasSubstr("ln -s liborbbec.so liborbbec.so.0"));
  fs::create_symlink("liborbbec.so", folder_.path() / "liborbbec.so.0");
  EXPECT_EQ(Only().file.filename(), "liborbbec.so.0");
  EXPECT_THAT(Only().problem.English(), IsEmpty());
}

TEST_F(OpenNiDriverFilesTest, WhatCannotBeLoadedSaysWhy) {
  std::ofstream(folder_.path() / "liborbbec.so.0") << std::string(200, 'x');
  EXPECT_THAT(Only().problem.English(), AllOf(HasSubstr("cannot be loaded"), HasSubstr("ELF")));
}

TEST_F(OpenNiDriverFilesTest, ALibraryThatIsNoDriverSaysSo) {
  Dl_info c_library{};
  ASSERT_NE(::dladdr(reinterpret_cast<void*>(&::getenv), &c_library), 0);
  fs::create_symlink(fs::canonical(c_library.dli_fname), folder_.path() / "libSomething.so.0");
  EXPECT_THAT(Only().problem.English(), HasSubstr("not an OpenNI 2 driver"));
}

TEST_F(OpenNiDriverFilesTest, OtherFilesAndAMissingFolderAreNoDrivers) {
  std::ofstream(folder_.path() / "orbbec.ini") << "[Device]";
  EXPECT_THAT(FindOpenNiDrivers(folder_.path()), IsEmpty());
  EXPECT_THAT(FindOpenNiDrivers(folder_.path() / "missing"), IsEmpty());
}

TEST_F(OpenNiDriverFilesTest, DebiansDriversAreFoundWhereOpenNi2Looks) {
  const auto folder = OpenNiDriverFolder();
  ASSERT_TRUE(folder.has_value());
  bool has_ps1080 = false;
  for (const OpenNiDriverFile& driver : FindOpenNiDrivers(*folder)) {
    if (driver.file.filename() != "libPS1080.so.0") continue;
    has_ps1080 = true;
    EXPECT_TRUE(driver.is_debians);
    EXPECT_THAT(driver.problem.English(), IsEmpty());
  }
  EXPECT_TRUE(has_ps1080) << *folder;
}

}  // namespace
}  // namespace plumb
