// SPDX-License-Identifier: Apache-2.0
#include "algo/base/bounded_json.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "algo/base/errors.hpp"
#include "tests/support/message_of.hpp"

namespace plumb {
namespace {

using ::testing::HasSubstr;

std::string Nested(int depth) {
  return std::string(static_cast<std::size_t>(depth), '[') +
         std::string(static_cast<std::size_t>(depth), ']');
}

TEST(BoundedJsonTest, DepthIsBoundedOnBothSidesOfTheLimit) {
  EXPECT_TRUE(ParseBoundedJson(Nested(kMaxJsonDepth)).is_array());
  EXPECT_THROW((void)ParseBoundedJson(Nested(kMaxJsonDepth + 1)), DataError);
  EXPECT_TRUE(ParseBoundedJsonOrNothing(Nested(kMaxJsonDepth + 1)).is_discarded());
}

TEST(BoundedJsonTest, AReaderMayAskForLessDepth) {
  EXPECT_TRUE(ParseBoundedJson(R"({"a":1})", 1).is_object());
  EXPECT_TRUE(ParseBoundedJsonOrNothing(R"({"a":{}})", 1).is_discarded());
  EXPECT_TRUE(ParseBoundedJsonOrNothing(Nested(8), 8).is_array());
  EXPECT_THAT(plumb::testing::MessageOf<DataError>([] { (void)ParseBoundedJson(Nested(9), 8); }),
              HasSubstr("at most 8 deep"));
}

TEST(BoundedJsonTest, WhatWouldOverflowTheStackIsAnError) {
  constexpr int kDeep = 400'000;
  EXPECT_THROW((void)ParseBoundedJson(Nested(kDeep)), DataError);
  EXPECT_THROW((void)ParseBoundedJson(std::string(kDeep, '[')), DataError);
  EXPECT_THROW((void)ParseBoundedJson(R"({"a":)" + Nested(kDeep) + "}"), DataError);
}

TEST(BoundedJsonTest, WhatIsNoJsonSaysWhere) {
  EXPECT_THAT(
      plumb::testing::MessageOf<DataError>([] { (void)ParseBoundedJson(R"({"a": 1, "b")"); }),
      HasSubstr("not valid JSON"));
  EXPECT_THROW((void)ParseBoundedJson(""), DataError);
  EXPECT_THROW((void)ParseBoundedJson("1 2"), DataError);
  EXPECT_TRUE(ParseBoundedJsonOrNothing("nonsense").is_discarded());
  EXPECT_EQ(ParseBoundedJson(R"({"a":[1,2.5,"x"]})")["a"][1], 2.5);
}

TEST(BoundedJsonTest, TheKeysKeepTheirOrderWhereThatIsAskedFor) {
  constexpr const char* kText = R"({"b":1,"a":2})";
  EXPECT_EQ(ParseBoundedJson<nlohmann::ordered_json>(kText).dump(), kText);
  EXPECT_EQ(ParseBoundedJson(kText).dump(), R"({"a":2,"b":1})");
}

}  // namespace
}  // namespace plumb
