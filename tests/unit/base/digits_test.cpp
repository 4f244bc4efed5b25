#include <limits>

#include <gtest/gtest.h>

#include "algo/base/digits.hpp"

namespace plumb {
namespace {

TEST(DecimalsForTest, NoDigitIsShownBelowTheFirstOneOfTheUncertainty) {
  EXPECT_EQ(DecimalsFor(0.1, 2), 1);
  EXPECT_EQ(DecimalsFor(0.099, 2), 2);
  EXPECT_EQ(DecimalsFor(1.0, 2), 0);
  EXPECT_EQ(DecimalsFor(0.99, 2), 1);
  EXPECT_EQ(DecimalsFor(40.0, 2), 0);
  EXPECT_EQ(DecimalsFor(0.004, 2), 2) << "at most";
  EXPECT_EQ(DecimalsFor(0.0, 1), 1) << "unknown";
  EXPECT_EQ(DecimalsFor(std::numeric_limits<double>::quiet_NaN(), 1), 1);
}

}  // namespace
}  // namespace plumb
