// SPDX-License-Identifier: Apache-2.0
#include "algo/base/intrinsics.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

namespace plumb {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// A consumer sensor's lens, stronger than most.
Intrinsics Lens() {
  Intrinsics k;
  k.fx = 531.2;
  k.fy = 529.7;
  k.cx = 322.4;
  k.cy = 236.9;
  k.distortion = {0.08, -0.19, 0.0011, -0.0017, 0.04};
  return k;
}

TEST(Intrinsics, ProjectsThroughTheLensAsOpenCvDefinesIt) {
  // By hand for x = 0.2, y = 0.1: r2 = 0.05, radial = 1 + 0.08*0.05 - 0.19*0.0025 + 0.04*0.000125
  // = 1.00353; x" = 0.200706 + 2*0.0011*0.02 - 0.0017*(0.05+0.08) = 0.200529; y" = 0.100353 +
  // 0.0011*(0.05+0.02) - 2*0.0017*0.02 = 0.100362.
  const Vector2d pixel = Project(Lens(), Vector3d(0.4, 0.2, 2.0));
  EXPECT_NEAR(pixel.x(), 531.2 * 0.200529 + 322.4, 1e-9);
  EXPECT_NEAR(pixel.y(), 529.7 * 0.100362 + 236.9, 1e-9);
}

// As an Azure Kinect's factory states its cameras, at half the colour camera's size.
Intrinsics RationalLens() {
  return {640,
          360,
          302.0,
          301.8,
          318.7,
          182.5,
          {0.51, -2.74, 0.0006, -0.0002, 1.64, 0.39, -2.55, 1.56}};
}

TEST(Intrinsics, ProjectsThroughARationalLensAsOpenCvDefinesIt) {
  // For x = 0.3, y = 0.4: r2 = 0.25, numerator 1 + 0.51*0.25 - 2.74*0.0625 + 1.64*0.015625 =
  // 0.981875, denominator 1 + 0.39*0.25 - 2.55*0.0625 + 1.56*0.015625 = 0.9625; their ratio is
  // 1.0201299; x" = 0.30603896 + 2*0.0006*0.12 - 0.0002*(0.25+0.18) = 0.30609696; y" = 0.40805195 +
  // 0.0006*(0.25+0.32) - 2*0.0002*0.12 = 0.40834595.
  const Vector2d pixel = Project(RationalLens(), Vector3d(0.6, 0.8, 2.0));
  EXPECT_NEAR(pixel.x(), 302.0 * 0.30609696 + 318.7, 1e-5);
  EXPECT_NEAR(pixel.y(), 301.8 * 0.40834595 + 182.5, 1e-5);
}

TEST(Intrinsics, UndoesARationalLensAllOverTheImage) {
  const Intrinsics k = RationalLens();
  for (int y = 0; y < k.height; y += 13) {
    for (int x = 0; x < k.width; x += 17) {
      const Vector2d ideal = Undistort(k, Vector2d(x, y));
      ASSERT_LT((Project(k, ideal.homogeneous()) - Vector2d(x, y)).norm(), 1e-6) << x << " " << y;
    }
  }
}

TEST(Intrinsics, ARadialFactorsSlopeIsThatOfItsValue) {
  const auto& lens = RationalLens().distortion;
  constexpr double kStep = 1e-6;
  for (const double r2 : {0.0, 0.1, 0.5, 1.2}) {
    const double slope =
        (RadialFactorAt(lens, r2 + kStep).value - RadialFactorAt(lens, r2 - kStep).value) /
        (2 * kStep);
    EXPECT_NEAR(RadialFactorAt(lens, r2).slope, slope, 1e-8) << r2;
  }
}

TEST(Intrinsics, CoefficientsAreFiveOrEight) {
  EXPECT_EQ(LensCoefficients(Lens()).size(), 5U);
  EXPECT_EQ(LensCoefficients(RationalLens()).size(), 8U);
  for (const Intrinsics& from : {Lens(), RationalLens()}) {
    Intrinsics k = RationalLens();
    EXPECT_TRUE(SetLensCoefficients(LensCoefficients(from), k));
    EXPECT_EQ(k.distortion, from.distortion);
    EXPECT_FALSE(SetLensCoefficients(LensCoefficients(from).first(4), k));
    EXPECT_EQ(k.distortion, from.distortion) << "as it was";
  }
}

TEST(Intrinsics, UndoesTheLensAllOverTheImage) {
  const Intrinsics k = Lens();
  for (int y = 0; y < k.height; y += 13) {
    for (int x = 0; x < k.width; x += 17) {
      const Vector2d ideal = Undistort(k, Vector2d(x, y));
      // Measured: 2e-9 px in the farthest corner.
      ASSERT_LT((Project(k, 1.3 * ideal.homogeneous()) - Vector2d(x, y)).norm(), 1e-6)
          << x << " " << y;
    }
  }
}

TEST(Intrinsics, ResizedCameraSeesTheSamePlaces) {
  const Intrinsics k = Lens();
  const Intrinsics half = Resized(k, 320, 240);
  EXPECT_EQ(half.width, 320);
  EXPECT_EQ(half.height, 240);
  const Vector3d p(0.3, -0.2, 1.1);
  // Pixel (u, v) covers [u - 0.5, u + 0.5): the image's left edge is -0.5 at every size.
  const Vector2d full = Project(k, p);
  const Vector2d small = Project(half, p);
  EXPECT_NEAR(small.x() + 0.5, 0.5 * (full.x() + 0.5), 1e-10);
  EXPECT_NEAR(small.y() + 0.5, 0.5 * (full.y() + 0.5), 1e-10);
  const Intrinsics back = Resized(half, 640, 480);
  EXPECT_NEAR(back.cx, k.cx, 1e-12);
  EXPECT_NEAR(back.fy, k.fy, 1e-12);
}

}  // namespace
}  // namespace plumb
