// SPDX-License-Identifier: Apache-2.0
#include "algo/sensor_calibration/calibration_model.hpp"

#include <string>

#include <gtest/gtest.h>

#include "algo/sensor_calibration/calibration_prior.hpp"

namespace plumb {
namespace {

TEST(CalibrationModel, NothingWrongChangesNothing) {
  const CalibrationModel model;
  Intrinsics k;
  k.distortion = {0.1, -0.2, 0.001, 0.002, 0.03};
  EXPECT_EQ(model.Corrected(k), k);
  EXPECT_EQ(model.CorrectedDepth(0.87, {0.4, -0.3}), 0.87);
}

TEST(CalibrationModel, CorrectsTheLensInPixelsOfSixHundredAndFortyColumns) {
  CalibrationModel model;
  model.lens = {0.01, -0.02, 3.0, -4.0, 0.05, 0.06, 0.007, 0.008};
  Intrinsics k;
  k.width = 320;
  k.height = 240;
  k.fx = 200;
  k.fy = 300;
  k.cx = 160;
  k.cy = 120;
  const Intrinsics c = model.Corrected(k);
  EXPECT_DOUBLE_EQ(c.fx, 202.0);
  EXPECT_DOUBLE_EQ(c.fy, 294.0);
  EXPECT_DOUBLE_EQ(c.cx, 161.5);
  EXPECT_DOUBLE_EQ(c.cy, 118.0);
  EXPECT_DOUBLE_EQ(c.distortion[0], 0.05);
  EXPECT_DOUBLE_EQ(c.distortion[1], 0.06);
  EXPECT_DOUBLE_EQ(c.distortion[2], 0.007);
  EXPECT_DOUBLE_EQ(c.distortion[3], 0.008);
}

TEST(CalibrationModel, CorrectsDepthTermByTerm) {
  CalibrationModel model;
  model.depth = {0.01, 0.002, 0.004,  9, 9,
                 9,    0.003, -0.005, 9};  // Shifts and times are no matter of one depth value.
  // 0.8 (1 + 0.01 + 0.003 * 0.5 - 0.005 * -0.2) + 0.002 + 0.004 (0.25 + 0.04)
  EXPECT_NEAR(model.CorrectedDepth(0.8, {0.5, -0.2}), 0.8 * 1.0125 + 0.002 + 0.00116, 1e-12);
}

TEST(CalibrationModel, CentredCoordinatesStartInTheMiddleAndGoByHalfWidths) {
  EXPECT_EQ(CentredCoordinates(319.5, 239.5, 640, 480), Eigen::Vector2d(0, 0));
  EXPECT_EQ(CentredCoordinates(-0.5, 239.5, 640, 480), Eigen::Vector2d(-1, 0));
  EXPECT_EQ(CentredCoordinates(319.5, 479.5, 640, 480), Eigen::Vector2d(0, 0.75));
  // The same place at half the size.
  EXPECT_EQ(CentredCoordinates(-0.5, 119.5, 320, 240), Eigen::Vector2d(-1, 0));
}

TEST(CalibrationModel, NamesEveryParameter) {
  EXPECT_EQ(CalibrationModel{}.Named().size(),
            CalibrationModel::kLensSize + 1U + 1U + CalibrationModel::kDepthSize);
}

TEST(CalibrationModel, EachNameIsThatOfItsParameter) {
  CalibrationModel model;
  model.lens = {0.1, 0.2, 3, 4, 5, 6, 7, 8};
  model.readout_s[0] = 9;
  model.edge_bias_px[0] = 10;
  model.depth[kDepthScale] = 0.11;
  model.depth[kDepthBow] = 12;
  model.depth[kDepthShiftY] = 13;
  model.depth[kDepthDelay] = 14;
  model.depth[kDepthSlopeX] = 15;
  model.depth[kDepthReadout] = 16;
  model.depth[kDepthField + 1] = 17;
  model.depth[kDepthGrowth] = 18;
  const auto named = model.Named();
  EXPECT_DOUBLE_EQ(named.at("focal_y_scale"), 1.2);
  EXPECT_EQ(named.at("distortion_p2"), 8);
  EXPECT_EQ(named.at("color_readout_s"), 9);
  EXPECT_EQ(named.at("marker_edge_bias_px"), 10);
  EXPECT_DOUBLE_EQ(named.at("depth_scale"), 1.11);
  EXPECT_EQ(named.at("depth_bow_m"), 12);
  EXPECT_EQ(named.at("depth_shift_y_px"), 13);
  EXPECT_EQ(named.at("depth_delay_s"), 14);
  EXPECT_EQ(named.at("depth_slope_x"), 15);
  EXPECT_EQ(named.at("depth_readout_s"), 16);
  const auto order = [](const FieldOrder& term) {
    return std::to_string(term.x) + "_" + std::to_string(term.y);
  };
  EXPECT_EQ(named.at("depth_field_" + order(kFieldOrders[1])), 17);
  EXPECT_EQ(named.at("depth_field_growth_per_m_" + order(kGrowthOrders[0])), 18);
}

TEST(CalibrationPrior, SigmasAreThoseOfTheInverseAndASingularOneHasNone) {
  const CalibrationVector sigma = CalibrationVector::LinSpaced(0.001, 2.0);
  CalibrationMatrix information = sigma.cwiseAbs2().cwiseInverse().asDiagonal();
  const auto found = SigmasOf(information);
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((*found - sigma).cwiseAbs().maxCoeff(), 1e-12);
  information(0, 0) = 0.0;
  EXPECT_FALSE(SigmasOf(information).has_value());
}

}  // namespace
}  // namespace plumb
