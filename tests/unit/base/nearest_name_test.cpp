// SPDX-License-Identifier: Apache-2.0
#include "algo/base/nearest_name.hpp"

#include <array>

#include <gtest/gtest.h>

namespace plumb {
namespace {

TEST(NearestNameTest, IsTheOneWithTheFewestLettersToChange) {
  EXPECT_EQ(EditDistance("", "abc"), 3U);
  EXPECT_EQ(EditDistance("lenght", "length"), 2U);
  EXPECT_EQ(EditDistance("same", "same"), 0U);
  constexpr std::array kNames = {"marker_dictionary", "marker_length", "reference_marker"};
  EXPECT_EQ(NearestName("marker_lenght", kNames), "marker_length");
  EXPECT_EQ(NearestName("refrence_marker", kNames), "reference_marker");
  EXPECT_EQ(NearestName("x", std::array<const char*, 0>{}), "");
}

}  // namespace
}  // namespace plumb
