// SPDX-License-Identifier: Apache-2.0
#include "daemon/update/last_update.hpp"

#include <fstream>

#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "daemon/update/bundle_check.hpp"
#include "daemon/update/updater.hpp"
#include "tests/support/temp_folder.hpp"
#include "words/update.hpp"

namespace plumb {
namespace {

TEST(LastUpdateTest, WhatIsNotKnownIsNoRollBack) {
  const testing::TempFolder folder;

  const LastUpdate update{.version = "2", .from_slot = "A", .boot = "first"};
  EXPECT_TRUE(WhyRolledBack(update, "A", "second", "1").Is(say::update::kRolledBack));
  EXPECT_TRUE(WhyRolledBack(update, "A", "first", "1").empty());
  EXPECT_TRUE(WhyRolledBack(update, "B", "second", "1").empty());
  EXPECT_TRUE(WhyRolledBack(update, "", "second", "1").empty());
  EXPECT_TRUE(WhyRolledBack(update, "A", "", "1").empty());
  EXPECT_TRUE(
      WhyRolledBack({.version = "2", .from_slot = "A", .boot = ""}, "A", "second", "1").empty());
  for (const char* text : {"", "[]", "{", "{\"version\": 2}", "\xff\xfe"}) {
    std::ofstream(folder / "last-update.json") << text;
    EXPECT_FALSE(ReadLastUpdate(folder.path())) << text;
  }
  WriteLastUpdate(folder.path(), update);
  EXPECT_EQ(ReadLastUpdate(folder.path()), update);
  RemoveLastUpdate(folder.path());
  EXPECT_FALSE(ReadLastUpdate(folder.path()));
  EXPECT_NO_THROW(RemoveLastUpdate(folder.path())) << "there is none any more";
  std::filesystem::create_directories(folder / "last-update.json" / "not-empty");
  EXPECT_THROW(RemoveLastUpdate(folder.path()), IoError);
}

TEST(VersionTest, AreComparedNumberByNumber) {
  EXPECT_TRUE(IsOlder("0.9", "0.10"));
  EXPECT_TRUE(IsOlder("0.1.0", "0.1.1"));
  EXPECT_TRUE(IsOlder("", "0.1"));
  EXPECT_FALSE(IsOlder("0.1", "0.1.0"));
  EXPECT_FALSE(IsOlder("1.0", "0.99.99"));
  EXPECT_FALSE(IsOlder("0.01", "0.1")) << "leading zeros";
  EXPECT_FALSE(IsOlder("0.1", "0.01"));
  EXPECT_TRUE(IsOlder("1", "99999999999999999999"));
  EXPECT_FALSE(IsOlder("99999999999999999999", "1"));
}

TEST(VersionTest, ASystemOfAnotherFormCanBeUpdated) {
  EXPECT_TRUE(IsOlder("0.2.0", "0.2.1-rc1"));
  EXPECT_FALSE(IsOlder("0.2.1", "0.2.1-rc1"));
  EXPECT_FALSE(IsOlder("0.2.1", "0.2.1-rc1.7"));
}

TEST(VersionTest, OnlyNumbersWithDotsBetweenThemAreAVersion) {
  for (const char* good : {"0", "7", "0.2", "0.2.1", "10.20.30.40", "99999999999999999999"})
    EXPECT_TRUE(WhyNoVersion(good).empty()) << good;
  for (const char* bad : {"", ".", "1.", ".1", "1..2", "v1.0.0", "0.2.1-rc1", "0.2.1~git1", "1.0a",
                          "0.2+b", " 1", "1 ", "-1", "\xd9\xa1"})
    EXPECT_FALSE(WhyNoVersion(bad).empty()) << bad;
  EXPECT_EQ(WhyNoVersion("0.2.1-rc1").English(),
            "this bundle holds version '0.2.1-rc1': expected numbers separated by dots, such "
            "as 0.2.1; ask who made it");
}

TEST(VersionTest, AnImagesReleaseFileNamesTheSystem) {
  const testing::TempFolder folder;
  const auto with = [&](const std::string& text) {
    std::ofstream(folder / "release") << text;
    return VersionOfSystem(folder / "release", "0.2.0");
  };
  EXPECT_EQ(with("0.2.1 0123456789abcdef\n"), "0.2.1");
  EXPECT_EQ(with("0.3.0"), "0.3.0");
  EXPECT_EQ(with(""), "0.2.0");
  EXPECT_EQ(with("unknown\n"), "0.2.0");
  EXPECT_EQ(with(std::string(100'000, '1')), std::string(64, '1'));
  EXPECT_EQ(VersionOfSystem(folder / "none", "0.2.0"), "0.2.0");
}

}  // namespace
}  // namespace plumb
