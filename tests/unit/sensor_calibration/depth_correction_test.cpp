// SPDX-License-Identifier: Apache-2.0
#include "algo/sensor_calibration/depth_correction.hpp"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/SVD>

namespace plumb {
namespace {

CalibrationModel SomeCalibration() {
  CalibrationModel model;
  for (int i = 0; i < kNumDepthTerms; ++i)
    model.depth[static_cast<std::size_t>(i)] = 0.002 * std::sin(1.0 + i);
  return model;
}

TEST(DepthCorrection, SaysOfEveryCellWhatTheModelSays) {
  const CalibrationModel model = SomeCalibration();
  for (const int window_px : {1, 4}) {
    const DepthCorrection correction(model, 64, 48, window_px);
    const int width = 64 / window_px, height = 48 / window_px;
    for (const double z_m : {0.5, 0.9, 1.4, 2.5}) {
      for (int r = 0; r < height; r += 5) {
        for (int c = 0; c < width; c += 5) {
          const Eigen::Vector2d centred =
              CentredCoordinates((c + 0.5) * window_px - 0.5, (r + 0.5) * window_px - 0.5, 64, 48);
          EXPECT_NEAR(correction.Correct(static_cast<std::size_t>(r * width + c), z_m),
                      model.CorrectedDepth(z_m, centred), 1e-6);
        }
      }
    }
  }
}

TEST(DepthCorrection, SlopeIsTheDerivative) {
  const CalibrationModel model = SomeCalibration();
  const DepthCorrection correction(model, 64, 48, 4);
  constexpr double kStep_m = 1e-5;
  for (const double z_m : {0.5, 0.9, 1.4, 1.9, 2.5}) {
    for (std::size_t cell = 0; cell < 16 * 12; cell += 7) {
      const double difference =
          correction.Correct(cell, z_m + kStep_m) - correction.Correct(cell, z_m - kStep_m);
      EXPECT_NEAR(correction.Slope(cell, z_m), difference / (2 * kStep_m), 1e-7);
      EXPECT_GT(std::abs(correction.Slope(cell, z_m) - correction.Correct(cell, z_m) / z_m), 1e-5);
    }
  }
}

TEST(DepthField, EveryProductIsOneOrLessAndNoTwoAreTheSame) {
  FieldRow largest = FieldRow::Zero();
  Eigen::MatrixXf rows(21 * 16, FieldRow::RowsAtCompileTime);
  int at = 0;
  for (int c = 0; c <= 20; ++c)
    for (int r = 0; r <= 15; ++r) {
      const FieldRow row = FieldProducts({c / 10.0 - 1, r / 10.0 - 0.75});
      largest = largest.cwiseMax(row.cwiseAbs());
      rows.row(at++) = row.transpose();
    }
  EXPECT_FLOAT_EQ(largest.maxCoeff(), 1.0F);
  // The field's own terms, with the constant and the slopes beside them, are independent.
  Eigen::MatrixXf all(rows.rows(), kNumFieldTerms + 3);
  all.leftCols(kNumFieldTerms) = rows.leftCols(kNumFieldTerms);
  for (int i = 0; i < rows.rows(); ++i) {
    const int c = i / 16;
    const int r = i % 16;
    all.row(i).tail(3) << 1.0F, static_cast<float>(c) / 10 - 1, static_cast<float>(r) / 10 - 0.75F;
  }
  const Eigen::JacobiSVD<Eigen::MatrixXf> svd(all);
  EXPECT_LT(svd.singularValues()[0] / svd.singularValues().tail(1)[0], 20);
}

TEST(DepthField, GrowthStopsWhereNoSweepHasReadings) {
  EXPECT_DOUBLE_EQ(FieldGrowth(1.0), 0.0);
  EXPECT_DOUBLE_EQ(FieldGrowth(0.5), -0.5);
  EXPECT_DOUBLE_EQ(FieldGrowth(2.0), 1.0);
  EXPECT_DOUBLE_EQ(FieldGrowth(8.0), 1.0);
}

}  // namespace
}  // namespace plumb
