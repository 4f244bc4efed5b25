// SPDX-License-Identifier: Apache-2.0
#include "daemon/evaluation/number_errors.hpp"

#include <random>

#include <gtest/gtest.h>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

// A correction of zeros with the given half-widths of shifts and rotations.
Correction Still(double u95_mm, double u95_deg) {
  Correction correction;
  correction.isocentre_m = {0.6, 0.4, 0.1};
  correction.value = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  correction.u95 = {u95_mm, u95_mm, u95_mm, u95_deg, u95_deg, u95_deg};
  return correction;
}

TEST(NumberErrorsTest, TheTruthIsWhatWouldUndoTheMotionAtTheIsocentre) {
  // Up by 2 mm, turned by 1 deg about the isocentre: apply the opposite of each.
  const Eigen::Vector3d isocentre(0.6, 0.4, 0.1);
  const Pose turn(Eigen::AngleAxisd(1 * kDegree, Eigen::Vector3d::UnitZ()));
  const Pose motion = Eigen::Translation3d(isocentre + Eigen::Vector3d(0, 0, 0.002)) * turn *
                      Eigen::Translation3d(-isocentre);
  const TrueNumbers truth = TrueNumbersOf(motion, isocentre, Pose::Identity());
  const TrueNumbers expected = {-2.0, 0.0, 0.0, 0.0, 0.0, -1.0};
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(truth[i], expected[i], 1e-9) << kNumberNames[i];
}

TEST(NumberErrorsTest, EachNumberIsHeldAgainstItsOwnInterval) {
  const TrueNumbers truth = {0.9, -1.1, 1.0, 0.19, -0.21, 0.0};
  const NumberErrors errors = ErrorsOfNumbers(Still(1.0, 0.2), truth);
  const std::array<bool, 6> inside = {true, false, true, true, false, true};
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(errors[i]->IsInside(), inside[i]) << i;
  IntervalCoverage coverage;
  coverage.Add(errors);
  coverage.Add(ErrorsOfNumbers(Still(2.0, 0.4), truth));
  EXPECT_EQ(coverage.numbers[0].inside, 2U);
  EXPECT_EQ(coverage.numbers[1].inside, 1U);
  EXPECT_EQ(coverage.all.count, 12U);
  EXPECT_DOUBLE_EQ(coverage.all.Fraction(), 10.0 / 12);
}

TEST(NumberErrorsTest, RefusedShiftsAreNotCounted) {
  Correction couch = Still(1, 1);
  couch.value.vertical_mm.reset();
  const NumberErrors errors = ErrorsOfNumbers(couch, {});
  EXPECT_FALSE(errors[0]);
  IntervalCoverage coverage;
  coverage.Add(errors);
  EXPECT_EQ(coverage.numbers[0].count, 0U);
  EXPECT_EQ(coverage.all.count, 5U);
}

// The count that the product's promise is judged by must itself come out at 95 % for an honest
// interval, and must show one that is half as wide.
TEST(NumberErrorsTest, AnHonestIntervalIsCountedAsSuchAndAHalvedOneIsNot) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0.0, 1.0);
  IntervalCoverage honest, halved;
  for (int i = 0; i < 2000; ++i) {
    TrueNumbers truth;
    for (double& value : truth) value = normal(random);
    honest.Add(ErrorsOfNumbers(Still(1.96, 1.96), truth));
    halved.Add(ErrorsOfNumbers(Still(0.98, 0.98), truth));
  }
  for (const IntervalCount& number : honest.numbers) EXPECT_NEAR(number.Fraction(), 0.95, 0.015);
  EXPECT_NEAR(halved.all.Fraction(), 0.673, 0.015);
}

TEST(VerdictCountTest, HoldsEachVerdictAgainstTheTruth) {
  VerdictCount count;
  const TrueNumbers well_in = {1.4, 0, 0, 0.4, 0, 0}, in = {2.9, 0, 0, 0, 0, 0.9};
  const TrueNumbers out = {0, 0, 3.1, 0, 0, 0}, turned_out = {0, 0, 0, 0, -1.1, 0};
  count.Add(Verdict::kInTolerance, well_in, {});
  count.Add(Verdict::kUnsure, well_in, {});
  count.Add(Verdict::kInTolerance, in, {});
  count.Add(Verdict::kMove, in, {});
  count.Add(Verdict::kInTolerance, out, {});
  count.Add(Verdict::kNoAnswer, turned_out, {});
  EXPECT_EQ(count.truly_in, 4U);
  EXPECT_EQ(count.truly_out, 2U);
  EXPECT_EQ(count.well_in, 2U);
  EXPECT_EQ(count.in_tolerance, 3U);
  EXPECT_EQ(count.found_in, 2U);
  EXPECT_EQ(count.found_well_in, 1U);
  EXPECT_EQ(count.false_in_tolerance, 1U);
  EXPECT_EQ(count.false_move, 1U);
  EXPECT_EQ(count.unsure, 1U);
  EXPECT_EQ(count.move, 1U);
  EXPECT_EQ(count.no_answer, 1U);
}

}  // namespace
}  // namespace plumb
