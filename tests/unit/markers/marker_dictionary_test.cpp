// SPDX-License-Identifier: Apache-2.0
#include "algo/types/marker_dictionary.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <stdexcept>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "tests/support/message_of.hpp"

namespace plumb {
namespace {

using plumb::testing::MessageOf;
using ::testing::HasSubstr;

std::uint64_t RotatedQuarterTurn(std::uint64_t code, int side) {
  std::uint64_t rotated = 0;
  for (int row = 0; row < side; ++row) {
    for (int column = 0; column < side; ++column) {
      const int from = (side - 1 - column) * side + row;
      rotated = (rotated << 1) | ((code >> (side * side - 1 - from)) & 1U);
    }
  }
  return rotated;
}

int SmallestDistance(const MarkerDictionary& dictionary) {
  int smallest = 64;
  for (int a = 0; a < dictionary.size(); ++a) {
    std::uint64_t rotated = dictionary.Code(a);
    for (int turn = 0; turn < 4; ++turn) {
      for (int b = turn == 0 ? a + 1 : a; b < dictionary.size(); ++b)
        smallest = std::min(smallest, std::popcount(rotated ^ dictionary.Code(b)));
      rotated = RotatedQuarterTurn(rotated, dictionary.bits_per_side());
    }
  }
  return smallest;
}

TEST(MarkerDictionaryTest, EveryKnownNameIsFoundWithItsSizeAndBits) {
  for (const std::string& name : MarkerDictionary::KnownNames()) {
    const std::optional<MarkerDictionary> dictionary = MarkerDictionary::Find(name);
    ASSERT_TRUE(dictionary.has_value()) << name;
    EXPECT_EQ(dictionary->name(), name);
    EXPECT_GE(dictionary->size(), 30) << name;
    EXPECT_GE(dictionary->bits_per_side(), 4) << name;
  }
  EXPECT_EQ(MarkerDictionary::KnownNames().size(), 22U);
  EXPECT_EQ(MarkerDictionary::ByName("DICT_6X6_250").size(), 250);
  EXPECT_EQ(MarkerDictionary::ByName("dict_apriltag_36H11").name(), "DICT_APRILTAG_36h11");
}

TEST(MarkerDictionaryTest, UnknownNameIsNothingOrAnErrorThatListsTheKnownOnes) {
  EXPECT_FALSE(MarkerDictionary::Find("DICT_8X8_50").has_value());
  EXPECT_FALSE(MarkerDictionary::Find("").has_value());
  const std::string message =
      MessageOf<DataError>([] { (void)MarkerDictionary::ByName("DICT_8X8_50"); });
  EXPECT_THAT(message, HasSubstr("DICT_8X8_50"));
  EXPECT_THAT(message, HasSubstr("DICT_6X6_250"));
  EXPECT_THAT(message, HasSubstr("DICT_ARUCO_MIP_36h12"));
}

TEST(MarkerDictionaryTest, OwnTableKeepsHammingDistanceTwelveOverAllRotations) {
  const MarkerDictionary dictionary = MarkerDictionary::ByName("DICT_ARUCO_MIP_36h12");
  EXPECT_EQ(dictionary.size(), 250);
  EXPECT_EQ(dictionary.bits_per_side(), 6);
  EXPECT_EQ(SmallestDistance(dictionary), 12);  // the name says 12
  EXPECT_EQ(SmallestDistance(MarkerDictionary::ByName("DICT_APRILTAG_36h11")),
            11);  // the same function on a table of OpenCV's
}

TEST(MarkerDictionaryTest, EveryWordIsThatOfTheOrigin) {
  // FNV-1a over the words of each table, which were compared with their origin one by one.
  const std::pair<const char*, std::uint64_t> expected[] = {
      {"DICT_4X4_1000", 0xc6543b55c8dc8c0c},       {"DICT_5X5_1000", 0x666f680bb09d55a9},
      {"DICT_6X6_1000", 0x5c646b325640988f},       {"DICT_7X7_1000", 0xd2494b75807c5f72},
      {"DICT_APRILTAG_16h5", 0xfbaaef50ee55f655},  {"DICT_APRILTAG_25h9", 0x2dab9ab5b17886c3},
      {"DICT_APRILTAG_36h10", 0xdff19f85b9cdc6d1}, {"DICT_APRILTAG_36h11", 0x372ad3d15b787261},
      {"DICT_ARUCO_MIP_36h12", 0xfb8da4524b4ca76f}};
  for (const auto& [name, digest] : expected) {
    const MarkerDictionary dictionary = MarkerDictionary::ByName(name);
    std::uint64_t found = 0xcbf29ce484222325;
    for (int id = 0; id < dictionary.size(); ++id)
      found = (found ^ dictionary.Code(id)) * 0x100000001b3;
    EXPECT_EQ(found, digest) << name;
  }
}

TEST(MarkerDictionaryTest, PatternOfMarkerZeroIsTheKnownPrint) {
  // 0xd2b63a09d, row by row from the top left: what sheet generators print for id 0 of
  // ARUCO_MIP_36h12.
  const char* const expected[] = {"110100", "101011", "011000", "111010", "000010", "011101"};
  const MarkerDictionary dictionary = MarkerDictionary::ByName("DICT_ARUCO_MIP_36h12");
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 6; ++column)
      EXPECT_EQ(dictionary.Bit(0, row, column), expected[row][column] == '1')
          << row << ' ' << column;
}

TEST(MarkerDictionaryTest, RefusesIdsAndCellsThatDoNotExist) {
  const MarkerDictionary dictionary = MarkerDictionary::ByName("DICT_4X4_50");
  EXPECT_THROW((void)dictionary.Code(-1), std::invalid_argument);
  EXPECT_THROW((void)dictionary.Code(50), std::invalid_argument);
  EXPECT_THROW((void)dictionary.Bit(0, 4, 0), std::invalid_argument);
  EXPECT_THROW((void)dictionary.Bit(0, 0, -1), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
