// SPDX-License-Identifier: Apache-2.0
// What lets people and screens in, as the store keeps it: paired screens, second factors and PINs.
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/records/store.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/records/refusal_of.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb {
namespace {

using testing::kAnna;
using testing::kBert;
using ::testing::SizeIs;

class StoreLogInsTest : public ::testing::Test {
 protected:
  testing::TempFolder folder_;
};

TEST_F(StoreLogInsTest, PairedScreensStayOverARestart) {
  {
    Store store(folder_ / "state");
    (void)store.displays.Add(
        kAnna,
        {.id = {}, .name = "couch side", .token_hash = "ab", .paired_at = {}, .paired_by = {}});
  }
  Store store(folder_ / "state");
  ASSERT_THAT(store.displays.List(), SizeIs(1));
  EXPECT_EQ(store.displays.List()[0].paired_by, "anna");
  store.displays.Remove(kBert, store.displays.List()[0].id);
  EXPECT_THAT(store.displays.List(), SizeIs(0));
  EXPECT_EQ(RefusalOf([&] { store.displays.Remove(kBert, "1"); }), ChangeResult::kNotFound);
}

TEST_F(StoreLogInsTest, ASecondFactorChangesOnlyFromWhatItIsAndStaysOverARestart) {
  const SecondFactor first{.secret = "ABC", .last_step = 7, .recovery_hashes = {"aa", "bb"}};
  SecondFactor used = first;
  used.last_step = 8;
  used.recovery_hashes = {"bb"};
  {
    Store store(folder_ / "state");
    store.users.Add(kAnna, {.name = "anna",
                            .role = Role::kEngineer,
                            .password_hash = "hash",
                            .disabled = false,
                            .created_at = {},
                            .has_second_factor = false});
    EXPECT_FALSE(store.users.Find("anna")->has_second_factor);
    EXPECT_EQ(store.users.SecondFactorOf("anna"), std::nullopt);
    store.users.SetSecondFactor(kAnna, "anna", std::nullopt, first, "user.second_factor_on");
    EXPECT_EQ(store.audit.Find({0, 1}).at(0).action, "user.second_factor_on");
    EXPECT_EQ(store.audit.Find({0, 1}).at(0).subject, "anna");
    store.users.SetSecondFactor(kAnna, "anna", first, used, "");
    EXPECT_EQ(store.audit.Find({0, 1}).at(0).action, "user.second_factor_on")
        << "a use is no entry";
    EXPECT_EQ(RefusalOf([&] { store.users.SetSecondFactor(kAnna, "anna", first, used, ""); }),
              ChangeResult::kConflict)
        << "the same code at the same time";
    EXPECT_EQ(RefusalOf([&] { store.users.SetSecondFactor(kAnna, "bob", {}, first, ""); }),
              ChangeResult::kNotFound);
  }
  Store store(folder_ / "state");
  EXPECT_TRUE(store.users.Find("anna")->has_second_factor);
  EXPECT_EQ(store.users.SecondFactorOf("anna"), used);
  store.users.SetSecondFactor(kAnna, "anna", used, std::nullopt, "user.second_factor_off");
  EXPECT_FALSE(store.users.Find("anna")->has_second_factor);
}

TEST_F(StoreLogInsTest, APinIsKeptUntilItsOwnerRemovesIt) {
  {
    Store store(folder_ / "state");
    store.users.Add(kAnna, {.name = "anna",
                            .role = Role::kEngineer,
                            .password_hash = "hash",
                            .disabled = false,
                            .created_at = {},
                            .has_second_factor = false});
    EXPECT_EQ(store.users.PinOf("anna"), std::nullopt);
    for (const char* hash : {"first", "second"}) store.users.SetPin(kAnna, "anna", hash);
    EXPECT_EQ(store.audit.Find({0, 1}).at(0).action, "user.pin_set");
    EXPECT_EQ(RefusalOf([&] { store.users.SetPin(kAnna, "bob", "hash"); }),
              ChangeResult::kNotFound);
  }
  Store store(folder_ / "state");
  EXPECT_EQ(store.users.PinOf("anna"), "second");
  store.users.SetPin(kAnna, "anna", std::nullopt);
  EXPECT_EQ(store.users.PinOf("anna"), std::nullopt);
  EXPECT_EQ(store.audit.Find({0, 1}).at(0).action, "user.pin_removed");
}

TEST_F(StoreLogInsTest, AProvisionedScreenIsPairedOnceForEachKey) {
  Display display{.id = {}, .name = "Room 1", .token_hash = "ab", .paired_at = {}, .paired_by = {}};
  {
    Store store(folder_ / "state");
    EXPECT_TRUE(store.displays.AddProvisioned(display));
    EXPECT_FALSE(store.displays.AddProvisioned(display));
  }
  {
    Store store(folder_ / "state");
    display.name = "Room 2";
    EXPECT_FALSE(store.displays.AddProvisioned(display)) << "the same key, whatever its name";
    ASSERT_THAT(store.displays.List(), SizeIs(1));
    EXPECT_EQ(store.displays.List()[0].name, "Room 1");
    EXPECT_EQ(store.displays.List()[0].token_hash, "ab");
    EXPECT_EQ(store.displays.List()[0].paired_by, "plumbd");
    store.displays.Remove(kBert, store.displays.List()[0].id);
  }
  Store store(folder_ / "state");
  EXPECT_FALSE(store.displays.AddProvisioned(display)) << "what was removed stays removed";
  EXPECT_THAT(store.displays.List(), SizeIs(0));
  display.token_hash = "cd";
  EXPECT_TRUE(store.displays.AddProvisioned(display)) << "a new key";
  EXPECT_THAT(store.displays.List(), SizeIs(1));
  const auto log = store.audit.Find({0, 10, "display."});
  ASSERT_THAT(log, SizeIs(3)) << "newest first";
  EXPECT_EQ(log[0].action, "display.provision");
  EXPECT_EQ(log[0].subject, "Room 2");
  EXPECT_EQ(log[1].action, "display.remove");
  EXPECT_EQ(log[2].action, "display.provision");
  EXPECT_EQ(log[2].user, "plumbd");
  EXPECT_EQ(log[2].detail.English(), "") << "nothing of the key";
}

TEST_F(StoreLogInsTest, AProvisionedScreenThatHasNoPlaceIsPairedOnceThereIsOne) {
  Store store(folder_ / "state");
  const auto screen = [](std::size_t number) {
    return Display{.id = {},
                   .name = "screen",
                   .token_hash = std::to_string(number),
                   .paired_at = {},
                   .paired_by = {}};
  };
  for (std::size_t i = 0; i < kMaxDisplays; ++i) (void)store.displays.Add(kAnna, screen(i));
  const Display last = screen(kMaxDisplays);
  EXPECT_EQ(RefusalOf([&] { (void)store.displays.AddProvisioned(last); }), ChangeResult::kConflict);
  EXPECT_THAT(store.displays.List(), SizeIs(kMaxDisplays));
  store.displays.Remove(kAnna, "1");
  EXPECT_TRUE(store.displays.AddProvisioned(last));
  EXPECT_THAT(store.displays.List(), SizeIs(kMaxDisplays));
}

}  // namespace
}  // namespace plumb
