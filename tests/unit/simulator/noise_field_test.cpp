// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/sensor/noise_field.hpp"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>

namespace plumb::simulated {
namespace {

constexpr int kColumns = 640;
constexpr int kRows = 480;

double Correlation(const std::vector<float>& field, int lag) {
  double sum = 0;
  for (int y = 0; y < kRows; ++y) {
    for (int x = 0; x < kColumns; ++x) {
      sum += field[static_cast<std::size_t>(y * kColumns + x)] *
             field[static_cast<std::size_t>(y * kColumns + (x + lag) % kColumns)];
    }
  }
  return sum / (kColumns * kRows);
}

TEST(NoiseFieldTest, HasUnitVarianceAndTheGaussiansCorrelation) {
  const double sigma = FilterSigmaOfLag(9.0);
  // A field of 640 x 480 with this filter holds about 2700 independent values: the spread of a
  // second moment is sqrt(2 / 2700) = 0.027; limits are three times that.
  const std::vector<float> field = CorrelatedNoise(5, kColumns, kRows, sigma);
  double mean = 0;
  for (const float value : field) mean += value;
  EXPECT_NEAR(mean / (kColumns * kRows), 0.0, 0.06);
  EXPECT_NEAR(Correlation(field, 0), 1.0, 0.08);
  EXPECT_NEAR(Correlation(field, 3), std::exp(-9.0 / (4 * sigma * sigma)), 0.08);
  EXPECT_NEAR(Correlation(field, 9), 0.10, 0.08);
  EXPECT_NEAR(Correlation(field, 30), 0.0, 0.08);
}

TEST(NoiseFieldTest, IsWhiteWithoutAFilter) {
  // 307,200 independent values: spread 0.0026.
  const std::vector<float> field = CorrelatedNoise(6, kColumns, kRows, 0.0);
  EXPECT_NEAR(Correlation(field, 0), 1.0, 0.01);
  EXPECT_NEAR(Correlation(field, 1), 0.0, 0.01);
}

TEST(NoiseFieldTest, DoesNotDependOnTheNumberOfThreads) {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const std::vector<float> single = CorrelatedNoise(7, 160, 120, 2.0);
  const tbb::global_control four(tbb::global_control::max_allowed_parallelism, 4);
  EXPECT_EQ(single, CorrelatedNoise(7, 160, 120, 2.0));
  EXPECT_NE(single, CorrelatedNoise(8, 160, 120, 2.0));
}

}  // namespace
}  // namespace plumb::simulated
