// SPDX-License-Identifier: Apache-2.0
#include "algo/base/ascii_lower.hpp"

#include <gtest/gtest.h>

namespace plumb {
namespace {

TEST(AsciiLowerTest, OnlyCapitalsFromAToZChange) {
  EXPECT_EQ(AsciiLower("AZaz09@[`{"), "azaz09@[`{");
  EXPECT_EQ(AsciiLower("Ä ÉÇ"), "Ä ÉÇ") << "letters of several bytes";
  EXPECT_EQ(AsciiLower(""), "");
}

}  // namespace
}  // namespace plumb
