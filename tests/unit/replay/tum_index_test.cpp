// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/tum_index.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "algo/base/errors.hpp"
#include "tests/support/message_of.hpp"

namespace plumb {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::MessageOf;

std::vector<IndexEntry> At(std::initializer_list<double> times_s) {
  std::vector<IndexEntry> entries;
  for (const double time_s : times_s) entries.push_back({time_s, "x"});
  return entries;
}

std::string RefusalOfIndex(std::string_view text) {
  return MessageOf<DataError>([&] { (void)ParseIndex(text, "rgb.txt"); });
}

TEST(TumIndexTest, ReadsStampsAndNamesAroundComments) {
  const auto entries =
      ParseIndex("# color\r\n\n1.5 rgb/a.png\r\n  2.25\trgb/b c.png  \n1305031102.175304,rgb/d.png",
                 "rgb.txt");
  ASSERT_EQ(entries.size(), 3U);
  EXPECT_EQ(entries[0].time_s, 1.5);
  EXPECT_EQ(entries[0].file, "rgb/a.png");
  EXPECT_EQ(entries[1].file, "rgb/b c.png");
  EXPECT_EQ(entries[2].time_s, 1305031102.175304);
  EXPECT_TRUE(ParseIndex("", "rgb.txt").empty());
}

TEST(TumIndexTest, ReadsWhatEditorsAndOtherSystemsMakeOfAList) {
  const auto entries = ParseIndex(
      "\xef\xbb\xbf# color\r\n1.5 rgb\\a.png\r\n2.5 \"rgb/b.png\"\r\n3.5 'rgb/c d.png'\n",
      "rgb.txt");
  ASSERT_EQ(entries.size(), 3U);
  EXPECT_EQ(entries[0].file, "rgb/a.png");
  EXPECT_EQ(entries[1].file, "rgb/b.png");
  EXPECT_EQ(entries[2].file, "rgb/c d.png");
  EXPECT_EQ(ParseIndex("\xef\xbb\xbf"
                       "1.5 a\n",
                       "rgb.txt")
                .size(),
            1U);
  EXPECT_THAT(RefusalOfIndex(std::string("\xff\xfe"
                                         "1\0.\0",
                                         6)),
              HasSubstr("UTF-16"));
  EXPECT_THAT(RefusalOfIndex("1.0 ..\\..\\secret\n"), HasSubstr("leaves"));
  EXPECT_THAT(RefusalOfIndex("1.0 C:\\rgb\\a.png\n"), HasSubstr("leaves"));
  EXPECT_THAT(RefusalOfIndex("1.0 \"../a.png\"\n"), HasSubstr("leaves"));
}

TEST(TumIndexTest, NanAndGarbageStampsAreNamedWithTheirLine) {
  EXPECT_THAT(RefusalOfIndex("1.0 a\nnan b\n"),
              AllOf(HasSubstr("rgb.txt line 2"), HasSubstr("\"nan\""), HasSubstr("seconds")));
  EXPECT_THAT(RefusalOfIndex("1.0 a\ninf b\n"), HasSubstr("\"inf\""));
  EXPECT_THAT(RefusalOfIndex("1.0x a\n"), HasSubstr("\"1.0x\""));
  EXPECT_THAT(RefusalOfIndex("-1.0 a\n"), HasSubstr("\"-1.0\""));
  EXPECT_THAT(RefusalOfIndex("hello a\n"), HasSubstr("line 1"));
  EXPECT_THAT(RefusalOfIndex(std::string("\x01\x02\xff a\n")), HasSubstr("\"???\""));
  EXPECT_THAT(RefusalOfIndex("1e999 a\n"), HasSubstr("1e999"));
  EXPECT_THAT(RefusalOfIndex("1403636579763555584 a\n"), HasSubstr("nanoseconds"));
}

TEST(TumIndexTest, UnsortedAndRepeatedStampsAreNamed) {
  EXPECT_THAT(
      RefusalOfIndex("1.0 a\n3.0 b\n2.0 c\n"),
      AllOf(HasSubstr("line 3"), HasSubstr("earlier"), HasSubstr("3.000000"), HasSubstr("sort")));
  EXPECT_THAT(RefusalOfIndex("1.0 a\n1.0 b\n"), AllOf(HasSubstr("line 2"), HasSubstr("repeats")));
}

TEST(TumIndexTest, PathsThatLeaveTheFolderAreNamed) {
  EXPECT_THAT(RefusalOfIndex("1.0 ../../etc/passwd\n"),
              AllOf(HasSubstr("line 1"), HasSubstr("leaves"), HasSubstr("../../etc/passwd")));
  EXPECT_THAT(RefusalOfIndex("1.0 /etc/passwd\n"), HasSubstr("leaves"));
  EXPECT_THAT(RefusalOfIndex("1.0 rgb/../../a.png\n"), HasSubstr("leaves"));
  EXPECT_EQ(ParseIndex("1.0 rgb/..a.png\n", "rgb.txt").size(),
            1U);  // dots in a name are no way out
}

TEST(TumIndexTest, MissingNamesAndEndlessLinesAreNamed) {
  EXPECT_THAT(RefusalOfIndex("1.0\n"),
              AllOf(HasSubstr("line 1"), HasSubstr("file name is missing")));
  EXPECT_THAT(RefusalOfIndex("1.0 " + std::string(5000, 'a')), HasSubstr("5004 characters"));
  EXPECT_THAT(RefusalOfIndex(std::string("1.0 a\0b\n", 8)), HasSubstr("zero byte"));
}

TEST(TumIndexTest, PairsNearestStamps) {
  EXPECT_THAT(AssociateByTime(At({0.000, 0.033, 0.066}), At({0.010, 0.040, 0.070}), 0.02),
              ElementsAre(IndexPair{0, 0}, IndexPair{1, 1}, IndexPair{2, 2}));
}

TEST(TumIndexTest, GapsLeaveImagesWithoutPartner) {
  EXPECT_THAT(AssociateByTime(At({0.0, 0.1, 0.2, 0.3}), At({0.005, 0.205, 0.9}), 0.02),
              ElementsAre(IndexPair{0, 0}, IndexPair{2, 1}));
  EXPECT_THAT(AssociateByTime(At({0.0}), At({0.0201}), 0.02), ElementsAre());
  EXPECT_THAT(AssociateByTime({}, At({0.0}), 0.02), ElementsAre());
}

// Half a frame apart with jitter: taking the nearest pairs first, 0-0 (16.2 ms) and 2-1 (15.5 ms),
// would leave 1 and 2 alone.
TEST(TumIndexTest, StreamsHalfAFrameApartLoseNoImage) {
  EXPECT_THAT(AssociateByTime(At({0.000, 0.033, 0.066}), At({0.0162, 0.0505, 0.082}), 0.02),
              ElementsAre(IndexPair{0, 0}, IndexPair{1, 1}, IndexPair{2, 2}));
}

TEST(TumIndexTest, ASlowerDepthStreamTakesTheNearestColour) {
  EXPECT_THAT(
      AssociateByTime(At({0.0, 0.0167, 0.0333, 0.05, 0.0667}), At({0.001, 0.0343, 0.0677}), 0.02),
      ElementsAre(IndexPair{0, 0}, IndexPair{2, 1}, IndexPair{4, 2}));
}

TEST(TumIndexTest, StampsDenserThanTheGapKeepTimeRising) {
  std::vector<IndexEntry> color;
  std::vector<IndexEntry> depth;
  for (int i = 0; i < 2000; ++i) {
    color.push_back({i * 1e-5, "c"});
    depth.push_back({i * 1.1e-5 + 0.003, "d"});
  }
  const auto pairs = AssociateByTime(color, depth, 0.02);
  ASSERT_FALSE(pairs.empty());
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    EXPECT_GT(pairs[i].color, pairs[i - 1].color);
    EXPECT_GT(pairs[i].depth, pairs[i - 1].depth);
  }
}

}  // namespace
}  // namespace plumb
