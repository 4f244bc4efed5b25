// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/sealed_pages.hpp"

#include <array>
#include <vector>

#include <gtest/gtest.h>

namespace plumb {
namespace {

TEST(SealedPagesTest, EachSingleBitIsNoticed) {
  std::array<std::uint8_t, kPageBytes> page{};
  for (std::size_t i = 0; i < page.size(); i += 3) page[i] = static_cast<std::uint8_t>(i);
  SealPage(page, 7);
  ASSERT_TRUE(IsSealed(page, 7));
  for (std::size_t bit = 0; bit < 8 * page.size(); ++bit) {
    page[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
    ASSERT_FALSE(IsSealed(page, 7)) << bit;
    page[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
  }
}

TEST(SealedPagesTest, APageInAnothersPlaceIsNoticed) {
  std::array<std::uint8_t, kPageBytes> page{};
  EXPECT_FALSE(IsSealed(page, 1)) << "a page of zeros, as a disk gives for one that it lost";
  SealPage(page, 1);
  EXPECT_FALSE(IsSealed(page, 2));
}

/// File format, 4.2: with 32-bit words x0, x1: s0 += x0 + s1, s1 += x1 + s0.
TEST(SealedPagesTest, TheSumOfTheLogIsSQLites) {
  LogSum sum;
  const std::vector<std::uint8_t> bytes = {1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 4, 0, 0, 0};
  sum.Add(bytes);
  EXPECT_EQ(sum.a, 7U);
  EXPECT_EQ(sum.b, 14U);
}

}  // namespace
}  // namespace plumb
