// SPDX-License-Identifier: Apache-2.0
#include "algo/base/base64.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <utility>

namespace plumb {
namespace {

// RFC 4648, section 10.
TEST(Base64Test, IsThatOfTheStandard) {
  for (const auto& [bytes, text] : {std::pair("", ""), std::pair("f", "Zg=="),
                                    std::pair("fo", "Zm8="), std::pair("foobar", "Zm9vYmFy")}) {
    EXPECT_EQ(ToBase64(bytes), text);
    EXPECT_EQ(FromBase64(text), std::string(bytes));
  }
  EXPECT_EQ(ToBase64("\xFB\xFF"), "+/8=");
  EXPECT_EQ(ToBase64Url("\xFB\xFF"), "-_8");
}

TEST(Base64Test, WhatIsNotWhollyBase64IsNothing) {
  for (const char* wrong : {"Zg", "Zg=", "Zg==x", "Z g==", "-_8=", "Z===", "=", "Zh=="})
    EXPECT_EQ(FromBase64(wrong), std::nullopt) << wrong;
}

}  // namespace
}  // namespace plumb
