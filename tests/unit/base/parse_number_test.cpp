// SPDX-License-Identifier: Apache-2.0
#include "algo/base/parse_number.hpp"

#include <cstdint>

#include <gtest/gtest.h>

namespace plumb {
namespace {

TEST(ParseNumberTest, TheWholeTextIsANumberOrThereIsNone) {
  EXPECT_EQ(ParseNumber<int>("42"), 42);
  EXPECT_EQ(ParseNumber<int>("-7"), -7);
  EXPECT_EQ(ParseNumber<double>("2.5"), 2.5);
  for (const char* text : {"", " 1", "1 ", "+1", "1x", "x", "1.5", "99999999999"})
    EXPECT_EQ(ParseNumber<int>(text), std::nullopt) << text;
  EXPECT_EQ(ParseNumber<std::int64_t>("99999999999"), 99'999'999'999);
  EXPECT_EQ(ParseNumber<unsigned>("-1"), std::nullopt);
}

}  // namespace
}  // namespace plumb
