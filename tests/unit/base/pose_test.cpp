// SPDX-License-Identifier: Apache-2.0
#include "algo/base/pose.hpp"

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

namespace plumb {
namespace {

using Eigen::Vector3d;
constexpr double kPi = std::numbers::pi;

TEST(Pose, RotationVectorsGoThereAndBackAtEveryLength) {
  const Vector3d axis = Vector3d(0.3, -0.8, 0.5).normalized();
  for (const double angle : {0.0, 1e-12, 1e-8, 1e-4, 0.1, 1.0, 3.0, kPi - 1e-6}) {
    const Eigen::Matrix3d R = RotationFromVector(axis * angle);
    // Measured: 4e-16; back, 2e-10 next to pi, where the axis comes from small differences.
    EXPECT_LT((R - Eigen::AngleAxisd(angle, axis).toRotationMatrix()).norm(), 1e-13) << angle;
    EXPECT_LT((VectorFromRotation(R) - axis * angle).norm(), 1e-8) << angle;
  }
}

TEST(Pose, SkewIsTheCrossProduct) {
  const Vector3d w(1, 2, 3);
  const Vector3d p(-4, 0.5, 7);
  EXPECT_EQ(Skew(w) * p, w.cross(p));
}

TEST(Pose, TwistKeepsRotationAndTranslationApart) {
  Vector6d twist;
  twist << 0, 0, kPi / 2, 1, 2, 3;
  const Pose T = PoseFromTwist(twist);
  EXPECT_LT((T * Vector3d(1, 0, 0) - Vector3d(1, 3, 3)).norm(), 1e-14);
  EXPECT_LT((TwistFromPose(T) - twist).norm(), 1e-12);
  EXPECT_NEAR(RotationAngle(T), kPi / 2, 1e-12);
}

TEST(Pose, InterpolatesAndExtrapolatesAtConstantVelocity) {
  Vector6d a;
  a << 0.1, -0.2, 0.3, 1, 2, 3;
  const Pose T_a = PoseFromTwist(a);
  const Vector3d axis = Vector3d(1, 1, -1).normalized();
  Pose T_b = T_a;
  T_b.rotate(Eigen::AngleAxisd(0.8, axis));
  T_b.translation() += Vector3d(0.2, -0.4, 0.6);
  for (const double fraction : {-0.5, 0.0, 0.25, 1.0, 1.5}) {
    const Pose T = Interpolate(T_a, T_b, fraction);
    const Eigen::Matrix3d expected =
        T_a.linear() * Eigen::AngleAxisd(0.8 * fraction, axis).toRotationMatrix();
    EXPECT_LT((T.linear() - expected).norm(), 1e-12) << fraction;
    EXPECT_LT((T.translation() - (T_a.translation() + fraction * Vector3d(0.2, -0.4, 0.6))).norm(),
              1e-12)
        << fraction;
  }
}

TEST(Pose, OrthonormalisesToTheNearestRotation) {
  Pose T = PoseFromTwist((Vector6d() << 0.4, -1.0, 0.2, 1, 2, 3).finished());
  const Eigen::Matrix3d R = T.linear();
  T.linear() *= 1.0 + 1e-3;  // A scaled rotation's nearest rotation is itself.
  EXPECT_LT((Orthonormalised(T).linear() - R).norm(), 1e-12);
  T.linear() = Vector3d(1, 1, -1).asDiagonal();  // A mirror must not survive.
  EXPECT_NEAR(Orthonormalised(T).linear().determinant(), 1.0, 1e-12);
}

TEST(Pose, KnowsWhatIsNotFinite) {
  Pose T = Pose::Identity();
  EXPECT_TRUE(IsFinite(T));
  T.translation().y() = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(IsFinite(T));
  T = Pose::Identity();
  T.linear()(1, 2) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(IsFinite(T));
}

}  // namespace
}  // namespace plumb
