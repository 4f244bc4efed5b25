// SPDX-License-Identifier: Apache-2.0
// Versions of a sensor unit's profile on the disk.
#include "daemon/sensor_profiles/profile_shelf.hpp"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

SensorProfile Profile(double focal) {
  Intrinsics stated;
  stated.width = 640;
  stated.height = 480;
  SensorProfile profile = ProfileOfAnyUnit(stated);
  profile.mean[kLensAt] = focal;
  profile.num_sweeps = 3;
  return profile;
}

double Focal(const ProfileShelf::InUse& in_use) {
  return in_use.newest.value().profile.value().mean[kLensAt];
}

TEST(ProfileShelf, GivesBackWhatWasLearnedLastToThatUnitAlone) {
  const testing::TempFolder folder;
  {
    ProfileShelf shelf(folder / "profiles");
    EXPECT_FALSE(shelf.Read("A").newest);
    EXPECT_EQ(shelf.Add("A", Profile(0.001)), 1);
    EXPECT_EQ(shelf.Add("A", Profile(0.002)), 2);
  }
  ProfileShelf shelf(folder / "profiles");
  const ProfileShelf::InUse in_use = shelf.Read("A");
  EXPECT_EQ(Focal(in_use), 0.002);
  EXPECT_EQ(in_use.fault.English(), "");
  EXPECT_EQ(in_use.newest->profile->name, "A version 2");
  EXPECT_EQ(in_use.newest->profile->num_sweeps, 3);
  EXPECT_EQ(in_use.newest->profile->covariance, Profile(0).covariance);
  EXPECT_EQ(in_use.newest->profile->stated, Profile(0).stated);
  EXPECT_EQ(in_use.newest->cause, ProfileCause::kLearned);
  EXPECT_LT(std::chrono::system_clock::now() - in_use.newest->made, std::chrono::minutes(1));
  EXPECT_FALSE(shelf.Read("B").newest);
  EXPECT_THROW(static_cast<void>(shelf.Read("")), std::invalid_argument);
}

TEST(ProfileShelf, SerialsStayInTheFolderAndNeverShareOne) {
  const testing::TempFolder folder;
  ProfileShelf shelf(folder / "profiles");
  const std::vector<std::string> serials = {
      "A_B", "A/B", "../A", "..", ".", "set-aside", std::string(300, 'x'), std::string(301, 'x'),
      "a\nb"};
  for (std::size_t i = 0; i < serials.size(); ++i)
    (void)shelf.Add(serials[i], Profile(static_cast<double>(i)));
  for (std::size_t i = 0; i < serials.size(); ++i)
    EXPECT_EQ(Focal(shelf.Read(serials[i])), static_cast<double>(i)) << serials[i];
  EXPECT_EQ(std::distance(fs::directory_iterator(folder / "profiles"), {}), 9);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST(ProfileShelf, KeepsTheLastTwentyVersions) {
  const testing::TempFolder folder;
  ProfileShelf shelf(folder / "profiles");
  for (int i = 1; i <= 20; ++i) (void)shelf.Add("A", Profile(i));
  EXPECT_EQ(shelf.Versions("A").back().version, 1);
  for (int i = 21; i <= 23; ++i) (void)shelf.Add("A", Profile(i));
  const std::vector<ProfileVersion> versions = shelf.Versions("A");
  ASSERT_EQ(versions.size(), 20U);
  EXPECT_EQ(versions.front().version, 23);
  EXPECT_EQ(versions.back().version, 4);
}

TEST(ProfileShelf, ADamagedVersionIsSetAsideAndScansGoOnWithout) {
  const testing::TempFolder folder;
  const fs::path file = folder / "profiles" / "A" / "000002.profile";
  const auto damage_each = [&](const std::function<std::string(std::string)>& damage) {
    fs::remove_all(folder / "profiles");
    ProfileShelf shelf(folder / "profiles");
    (void)shelf.Add("A", Profile(0.001));
    (void)shelf.Add("A", Profile(0.002));
    const std::string damaged = damage(ReadTextFile(file, 1U << 20U));
    std::ofstream(file) << damaged;
    const ProfileShelf::InUse in_use = shelf.Read("A");
    EXPECT_FALSE(in_use.newest);
    EXPECT_THAT(in_use.fault.English(), HasSubstr("set-aside"));
    EXPECT_FALSE(fs::exists(file));
    EXPECT_EQ(ReadTextFile(folder / "profiles" / "set-aside" / "A-000002.profile", 4U << 20U),
              damaged);
    // The next scan finds no profile either, and no fault: it was told.
    const ProfileShelf::InUse next = shelf.Read("A");
    EXPECT_EQ(next.fault.English(), "");
    ASSERT_TRUE(next.newest);
    EXPECT_FALSE(next.newest->profile);
    EXPECT_EQ(next.newest->cause, ProfileCause::kUnreadable);
    // The version before is there to be taken back.
    EXPECT_EQ(shelf.RollBack("A", 1), 4);
    EXPECT_EQ(Focal(shelf.Read("A")), 0.001);
  };
  damage_each([](const std::string& text) { return text.substr(0, text.size() / 2); });
  damage_each([](std::string text) {
    text[text.find("0.002")] = '1';  // still a profile, but not what was written
    return text;
  });
  damage_each([](const std::string&) { return std::string(); });
  damage_each([](const std::string&) { return std::string(2U << 20U, 'x'); });
}

TEST(ProfileShelf, AnotherUnitsFileIsNotUsed) {
  const testing::TempFolder folder;
  ProfileShelf shelf(folder / "profiles");
  (void)shelf.Add("A", Profile(0.001));
  fs::rename(folder / "profiles" / "A", folder / "profiles" / "B");
  const ProfileShelf::InUse in_use = shelf.Read("B");
  EXPECT_FALSE(in_use.newest);
  EXPECT_THAT(in_use.fault.English(), HasSubstr("belongs to the unit \"A\""));
}

TEST(ProfileShelf, AResetUnitBeginsAgainAndCanBeTakenBack) {
  const testing::TempFolder folder;
  ProfileShelf shelf(folder / "profiles");
  (void)shelf.Add("A", Profile(0.001));
  EXPECT_EQ(shelf.Reset("A"), 2);
  EXPECT_FALSE(shelf.Read("A").newest->profile);
  EXPECT_THROW(static_cast<void>(shelf.RollBack("A", 2)), DataError) << "it holds no profile";
  EXPECT_THROW(static_cast<void>(shelf.RollBack("A", 7)), DataError);
  EXPECT_EQ(shelf.RollBack("A", 1), 3);
  EXPECT_EQ(Focal(shelf.Read("A")), 0.001);
  EXPECT_EQ(shelf.Read("A").newest->cause, ProfileCause::kRolledBack);
}

}  // namespace
}  // namespace plumb
