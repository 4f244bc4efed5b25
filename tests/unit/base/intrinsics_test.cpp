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
