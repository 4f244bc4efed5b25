// SPDX-License-Identifier: Apache-2.0
#include <fstream>

#include <gtest/gtest.h>

#include "daemon/update/bundle_check.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using testing::TempFolder;

TEST(BundleDamageTest, WhatIsNoBundleIsUnknown) {
  const TempFolder folder;
  EXPECT_EQ(LookForDamage(folder / "none"), BundleState::kUnknown);
  for (const std::size_t size : {0U, 7U, 8U, 9U, 100U, 5000U}) {
    for (const char fill : {'\0', '\1', '\xFF'}) {
      std::ofstream(folder / "file", std::ios::binary) << std::string(size, fill);
      EXPECT_EQ(LookForDamage(folder / "file"), BundleState::kUnknown) << size;
    }
  }
}

}  // namespace
}  // namespace plumb
