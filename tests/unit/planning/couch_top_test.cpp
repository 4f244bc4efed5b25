// SPDX-License-Identifier: Apache-2.0
// The couch beneath a body, by the shape of what images show and as a planning system drew it.
#include "algo/planning/couch_top.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "algo/planning/contour_surface.hpp"

namespace plumb {
namespace {

// The flanks of a body are not a couch, however large, nor is a level side of a single slice.
TEST(CouchTopTest, OnlyALevelSideAlongTheScanIsACouch) {
  const auto slices = [](const std::function<double(double x, int i)>& top) {
    std::vector<ContourSlice> made;
    for (int i = 0; i < 20; ++i) {
      ContourSlice& slice = made.emplace_back();
      slice.y_m = 0.003 * i;
      FlatContour& contour = slice.contours.emplace_back();
      for (int k = -300; k <= 300; ++k) contour.emplace_back(0.001 * k, top(0.001 * k, i));
      contour.emplace_back(0.3, -0.2);
      contour.emplace_back(-0.3, -0.2);
    }
    return made;
  };
  const auto round = [](double x, int) { return std::sqrt(std::max(0.0, 0.09 - x * x)); };
  EXPECT_FALSE(CouchTop(slices(round)));
  const auto on_couch = [](double x, int) {
    return std::abs(x) < 0.2 ? 0.05 + std::sqrt(0.04 - x * x) : 0.05;
  };
  ASSERT_TRUE(CouchTop(slices(on_couch)));
  EXPECT_NEAR(*CouchTop(slices(on_couch)), 0.05, 1e-6);
  EXPECT_FALSE(CouchTop(
      slices([&](double x, int i) { return i % 10 == 0 ? on_couch(x, i) : round(x, i); })));
  // A third of the 20 slices are 7; what both sides of a slice show counts once.
  for (const int count : {6, 7}) {
    const auto some = [&](double x, int i) { return i < count ? on_couch(x, i) : round(x, i); };
    EXPECT_EQ(CouchTop(slices(some)).has_value(), count == 7);
  }
  // Slices through a finger or a cable say nothing of a couch, and hide none.
  std::vector<ContourSlice> with_narrow = slices(on_couch);
  for (const std::size_t i : {0U, 1U})
    with_narrow[i].contours = {{{-0.004, 0.1}, {0.0, 0.104}, {0.004, 0.1}}};
  ASSERT_TRUE(CouchTop(with_narrow));
  EXPECT_NEAR(*CouchTop(with_narrow), 0.05, 1e-6);
  EXPECT_FALSE(CouchTop(slices([&](double x, int i) { return on_couch(x, i) + 0.01 * i; })));
  EXPECT_FALSE(CouchTop({}));
}

FlatContour BoxUpTo(double top, double half_width = 0.25, double height = 0.05) {
  return {{-half_width, top - height},
          {half_width, top - height},
          {half_width, top},
          {-half_width, top}};
}

/// Twenty slices of a body that reaches up to 0.2 m.
std::vector<ContourSlice> ScannedSlices() {
  std::vector<ContourSlice> scan;
  for (int i = 0; i < 20; ++i) scan.push_back({0.003 * i, {BoxUpTo(0.2, 0.15, 0.25)}});
  return scan;
}

/// A structure in some of the slices; its contours at each place.
DrawnSupport SupportOf(const std::string& name, int from, int to,
                       const std::function<std::vector<FlatContour>(int)>& contours) {
  std::vector<ContourSlice> slices;
  for (int i = from; i < to; ++i)  // one slice for each contour, as structure sets have them
    for (const FlatContour& contour : contours(i)) slices.push_back({0.003 * i, {contour}});
  return {.name = name, .slices = Joined(std::move(slices))};
}

DrawnSupport BoxSupport(const std::string& name, int from, int to, double top) {
  return SupportOf(name, from, to, [top](int) { return std::vector<FlatContour>{BoxUpTo(top)}; });
}

TEST(CouchTopTest, TheHighestOfAllContoursOfAPlaceIsTheTop) {
  const DrawnSupport shell = SupportOf("shell", 0, 20, [](int) {
    return std::vector<FlatContour>{BoxUpTo(-0.05), BoxUpTo(-0.058, 0.24), BoxUpTo(-0.08, 0.02)};
  });
  const DrawnCouch couch = CouchAsDrawn(ScannedSlices(), {shell});
  ASSERT_EQ(couch.parts.size(), 1U);
  EXPECT_EQ(couch.parts[0].name, "shell");
  EXPECT_EQ(couch.top_m, std::vector<double>(20, -0.05));
}

TEST(CouchTopTest, ADrawnTopMayRiseByFiveMillimetres) {
  for (const double rise_m : {0.004, 0.006}) {
    const DrawnSupport rising = SupportOf("rising", 0, 20, [rise_m](int i) {
      return std::vector<FlatContour>{BoxUpTo(-0.05 + (i < 10 ? 0.0 : rise_m))};
    });
    const DrawnCouch couch = CouchAsDrawn(ScannedSlices(), {rising});
    EXPECT_EQ(couch.top_m.empty(), rise_m > 0.005);
    EXPECT_EQ(couch.not_used.size(), rise_m > 0.005 ? 1U : 0U);
  }
}

TEST(CouchTopTest, AShortStructureIsNoCouchAndALongOneCountsWhereItIs) {
  const DrawnSupport couch = BoxSupport("couch", 0, 20, -0.05);
  // What is drawn at a place is there up to its neighbours: 5 slices are 6 of 20 places, 6 are 7.
  const DrawnCouch with_block =
      CouchAsDrawn(ScannedSlices(), {BoxSupport("block", 0, 5, 0.03), couch});
  EXPECT_THAT(with_block.not_used, ::testing::ElementsAre("block"));
  EXPECT_EQ(with_block.top_m, std::vector<double>(20, -0.05));
  const DrawnCouch with_board =
      CouchAsDrawn(ScannedSlices(), {BoxSupport("board", 0, 6, 0.03), couch});
  EXPECT_TRUE(with_board.not_used.empty());
  EXPECT_EQ(with_board.parts.size(), 2U);
  EXPECT_EQ(with_board.top_m[6], 0.03);
  EXPECT_EQ(with_board.top_m[7], -0.05);
  // Drawn in every second slice, and not to the ends.
  DrawnSupport thin = BoxSupport("thin", 4, 15, -0.05);
  for (const std::ptrdiff_t i : {9, 7, 5, 3, 1}) thin.slices.erase(thin.slices.begin() + i);
  EXPECT_EQ(CouchAsDrawn(ScannedSlices(), {thin}).top_m, std::vector<double>(20, -0.05));
}

TEST(CouchTopTest, WhatNothingRisesAboveIsNoCouch) {
  for (const double below_m : {0.019, 0.021}) {
    const DrawnCouch couch =
        CouchAsDrawn(ScannedSlices(), {BoxSupport("plate", 0, 20, 0.2 - below_m)});
    EXPECT_EQ(couch.top_m.empty(), below_m < 0.02);
    EXPECT_EQ(couch.not_used.size(), below_m < 0.02 ? 1U : 0U);
  }
}

TEST(CouchTopTest, WhatLiesBelowLeavesNoContour) {
  ContourSlice slice{0.0, {BoxUpTo(0.2, 0.15, 0.25), BoxUpTo(-0.05), BoxUpTo(-0.03)}};
  RemoveBelow(-0.045, slice);
  ASSERT_EQ(slice.contours.size(), 2U);
  EXPECT_NEAR(AreaOf(slice.contours[0]), 0.3 * 0.245, 1e-9);
  EXPECT_NEAR(AreaOf(slice.contours[1]), 0.5 * 0.015, 1e-9);
}

}  // namespace
}  // namespace plumb
