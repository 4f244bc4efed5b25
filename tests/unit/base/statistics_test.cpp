// SPDX-License-Identifier: Apache-2.0
#include "algo/base/statistics.hpp"

#include <gtest/gtest.h>

namespace plumb {
namespace {

TEST(StatisticsTest, TheMedianIsTheMiddleValueOrTheUpperOfTwo) {
  std::vector<double> one = {4.0}, odd = {9.0, 1.0, 5.0}, even = {9.0, 1.0, 5.0, 2.0};
  EXPECT_EQ(TakeMedian(one), 4.0);
  EXPECT_EQ(TakeMedian(odd), 5.0);
  EXPECT_EQ(TakeMedian(even), 5.0);
  std::vector<float> none;
  EXPECT_THROW((void)TakeMedian(none), std::invalid_argument);
}

TEST(StatisticsTest, AQuantileIsTheMeasuredValueAtOrBelowItsRank) {
  std::vector<int> values = {50, 10, 40, 20, 30};
  EXPECT_EQ(TakeQuantile(values, 0.0), 10);
  EXPECT_EQ(TakeQuantile(values, 0.49), 20);
  EXPECT_EQ(TakeQuantile(values, 0.5), 30);
  EXPECT_EQ(TakeQuantile(values, 0.99), 40);
  EXPECT_EQ(TakeQuantile(values, 1.0), 50);
  EXPECT_THROW((void)TakeQuantile(values, -0.01), std::invalid_argument);
  EXPECT_THROW((void)TakeQuantile(values, 1.01), std::invalid_argument);
  values.clear();
  EXPECT_THROW((void)TakeQuantile(values, 0.5), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
