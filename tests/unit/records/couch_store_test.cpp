// SPDX-License-Identifier: Apache-2.0
// The profile of the couch in the store.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "daemon/records/store.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

const Actor kSigner{.user = "eve", .address = "::1"};

TEST(CouchStoreTest, TheProfileThatWasReadIsReplacedAndHolds) {
  const testing::TempFolder folder;
  auto store = std::make_unique<Store>(folder / "state");
  EXPECT_EQ(store->couch.Get().version, 0);
  CouchProfile couch{.name = "Couch 2",
                     .num_axes = 4,
                     .is_in_cm = true,
                     .reverses = {true, false, false, false, false, true},
                     .hides_rest = true,
                     .wraps = true};
  EXPECT_EQ(store->couch.Sign(kSigner, couch), "1");
  EXPECT_THROW(store->couch.Sign(kSigner, couch), StoreRefusal) << "version 1 is in force";

  store = nullptr;
  store = std::make_unique<Store>(folder / "state");
  const CouchProfile kept = store->couch.Get();
  EXPECT_EQ(kept.version, 1);
  EXPECT_EQ(kept.name, "Couch 2");
  EXPECT_EQ(kept.num_axes, 4);
  EXPECT_TRUE(kept.is_in_cm);
  EXPECT_TRUE(kept.hides_rest);
  EXPECT_TRUE(kept.wraps);
  EXPECT_EQ(kept.reverses, couch.reverses);
  EXPECT_EQ(kept.signed_by, "eve");
  EXPECT_LT(WallClock::now() - kept.signed_at, std::chrono::minutes(1));
  const AuditEntry entry = store->audit.Find({0, 1, "couch.set"}).at(0);
  EXPECT_EQ(entry.user, "eve");
  EXPECT_THAT(entry.detail.English(), ::testing::HasSubstr("4 axes, cm"));
  couch.version = 1;
  EXPECT_EQ(store->couch.Sign(kSigner, couch), "2");
}

TEST(CouchStoreTest, ADamagedProfileIsNeverReplacedByADefault) {
  const testing::TempFolder folder;
  Store store(folder / "state");
  const CouchProfile couch{.name = "Couch 2"};
  store.couch.Sign(kSigner, couch);
  for (const char* value : {"{}", "no JSON", R"({"version":1,"name":"a","num_axes":5})"}) {
    {
      StoreChange change(store.database());
      change->Run("UPDATE settings SET value = ? WHERE name = 'couch'", value);
      change.Commit();
    }
    EXPECT_THROW((void)store.couch.Get(), DataError) << value;
    EXPECT_THROW(store.couch.Sign(kSigner, couch), DataError) << value;
  }
}

}  // namespace
}  // namespace plumb
