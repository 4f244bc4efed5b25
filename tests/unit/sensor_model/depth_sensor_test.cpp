// SPDX-License-Identifier: Apache-2.0
#include "algo/sensor_model/depth_sensor.hpp"

#include <gtest/gtest.h>

namespace plumb {
namespace {

TEST(DepthSensorTest, StructuredLightIsTheDefaultOfEverything) {
  const DepthSensorClass& of_class = ClassOf(DepthSensor::kStructuredLight);
  EXPECT_EQ(of_class.noise, DepthNoise());
  EXPECT_EQ(of_class.range, UsableDepth());
  EXPECT_EQ(of_class.edge_px, 0);
}

TEST(DepthSensorTest, EveryClassHasANoiseThatCanBeUsedAndARange) {
  for (std::size_t i = 0; i < kNamesOf<DepthSensor>.size(); ++i) {
    const DepthSensorClass& of_class = ClassOf(static_cast<DepthSensor>(i));
    EXPECT_FALSE(FaultOf(of_class.noise)) << kNamesOf<DepthSensor>[i];
    EXPECT_GT(of_class.range.nearest_m, 0.0);
    EXPECT_GT(of_class.range.farthest_m, of_class.range.nearest_m + 1.0);
    EXPECT_EQ(Named<DepthSensor>(kNamesOf<DepthSensor>[i]), static_cast<DepthSensor>(i));
  }
}

// Measured on RealSense cameras at rest: 0.43 mm at 0.38 m, 1.04 at 0.62, 1.27 at 0.68, 14.8 at
// 2.7.
TEST(DepthSensorTest, TheNoiseOfActiveStereoIsTheMeasuredOne) {
  const DepthNoise& noise = ClassOf(DepthSensor::kActiveStereo).noise;
  EXPECT_NEAR(noise.SigmaFacing_m(0.38), 0.43e-3, 0.1e-3);
  EXPECT_NEAR(noise.SigmaFacing_m(0.62), 1.04e-3, 0.1e-3);
  EXPECT_NEAR(noise.SigmaFacing_m(0.68), 1.27e-3, 0.1e-3);
  EXPECT_NEAR(noise.SigmaFacing_m(2.7), 14.8e-3, 4e-3);
}

}  // namespace
}  // namespace plumb
