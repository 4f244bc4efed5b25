// SPDX-License-Identifier: Apache-2.0
#include "algo/base/plain_text.hpp"

#include <gtest/gtest.h>

namespace plumb {
namespace {

TEST(PlainTextTest, IsWellFormedUtf8WithoutControls) {
  EXPECT_TRUE(IsPlainText("links \xC3\xB6stlich \xE2\x82\xAC \xF0\x9F\xA6\xB4"));
  EXPECT_FALSE(IsPlainText("line\nbreak"));
  EXPECT_TRUE(IsPlainText("line\nbreak", true));
  EXPECT_FALSE(IsPlainText(std::string("a\0b", 3)));
  EXPECT_FALSE(IsPlainText("\xC0\xAF")) << "overlong";
  EXPECT_FALSE(IsPlainText("\xED\xA0\x80")) << "surrogate";
  EXPECT_FALSE(IsPlainText("\xF4\x90\x80\x80")) << "beyond Unicode";
  EXPECT_FALSE(IsPlainText("\xE2\x82")) << "cut";
  EXPECT_FALSE(IsPlainText("\xC2\x85")) << "control in two bytes";
}

TEST(PlainTextTest, HasNoFormatCharacters) {
  for (const char* format :
       {"\u00AD",     "\u0600",     "\u0605",     "\u061C",     "\u06DD",     "\u070F",
        "\u0890",     "\u08E2",     "\u180E",     "\u200B",     "\u200C",     "\u200D",
        "\u200E",     "\u200F",     "\u2028",     "\u2029",     "\u202A",     "\u202E",
        "\u2060",     "\u2064",     "\u2066",     "\u2069",     "\u206F",     "\uFEFF",
        "\uFFF9",     "\uFFFB",     "\U000110BD", "\U00013430", "\U0001BCA3", "\U0001D173",
        "\U000E0001", "\U000E0041", "\U000E007F"}) {
    EXPECT_FALSE(IsPlainText(std::string("P-") + format + "7", true)) << format;
    EXPECT_EQ(AsPlainText(std::string("P-") + format + "7"), "P-\uFFFD7");
  }
  for (const char* letter :
       {"\u00AC", "\u00AE", "\u0606", "\u061B", "\u2010", "\u2027", "\u202F", "\u2065", "\u2070",
        "\uFFFC", "\U000E0000", "\U000E0080", "张伟", "محمد", "🙂"})
    EXPECT_TRUE(IsPlainText(letter)) << letter;
}

TEST(PlainTextTest, WhatIsNotPlainIsReplacedOneByOne) {
  EXPECT_EQ(AsPlainText("senal \xF1 张\tx"), "senal \uFFFD 张\uFFFDx");
  EXPECT_EQ(AsPlainText(""), "");
}

}  // namespace
}  // namespace plumb
