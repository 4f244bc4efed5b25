// SPDX-License-Identifier: Apache-2.0
#include "algo/base/utf8.hpp"

#include <gtest/gtest.h>

namespace plumb {
namespace {

TEST(Utf8Test, WhatIsWellFormedStays) {
  for (const char* text : {"", "plain",
                           "se\xC3\xB1"
                           "al",
                           "\xE2\x82\xAC", "\xF0\x9F\x98\x80", "a\nb"})
    EXPECT_EQ(ValidUtf8(text), text);
}

TEST(Utf8Test, EachByteThatIsNoneOfUtf8IsReplaced) {
  const std::string mark = "\xEF\xBF\xBD";
  EXPECT_EQ(ValidUtf8("se\xF1"
                      "al"),
            "se" + mark + "al");
  EXPECT_EQ(ValidUtf8("\xC0\x80"), mark + mark) << "overlong";
  EXPECT_EQ(ValidUtf8("\xED\xA0\x80"), mark + mark + mark) << "a surrogate";
  EXPECT_EQ(ValidUtf8("\xF4\x90\x80\x80"), mark + mark + mark + mark) << "beyond the last";
  EXPECT_EQ(ValidUtf8("a\xE2\x82"), "a" + mark + mark) << "cut off";
}

}  // namespace
}  // namespace plumb
