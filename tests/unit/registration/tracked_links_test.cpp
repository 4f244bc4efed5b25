// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/tracked_links.hpp"

#include <gtest/gtest.h>

#include "tests/unit/bundle/derivatives.hpp"
#include "tests/unit/tracking/synthetic_map.hpp"

namespace plumb {
namespace {

// Two keyframes that nothing but their link holds.
TrackingMap Linked() {
  TrackingMap map = synthetic::MakeTrueMap({.num_keyframes = 2, .num_landmarks = 10}).map;
  for (MapKeyframe& keyframe : map.keyframes) {
    keyframe.keypoints.clear();
    keyframe.data.markers.clear();
  }
  map.keyframes[1].previous = 0;
  map.keyframes[1].T_previous_color =
      map.keyframes[0].T_world_color.inverse() * map.keyframes[1].T_world_color *
      PoseFromTwist((Vector6d() << 0.002, -0.001, 0.003, 0.004, 0.002, -0.005).finished());
  return map;
}

// 1/2 |r|^2 of the formula in keyframe_link.hpp.
double Cost(const TrackingMap& map, const Vector6d& twist_a, const Vector6d& twist_b) {
  const Pose T_world_a = map.keyframes[0].T_world_color * PoseFromTwist(twist_a);
  const Pose T_world_b = map.keyframes[1].T_world_color * PoseFromTwist(twist_b);
  const Pose& measured = map.keyframes[1].T_previous_color;
  const Pose T_a_b = T_world_a.inverse() * T_world_b;
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(measured.linear().transpose() * T_a_b.linear()));
  const double turned = turn.angle() / 0.004;
  const double shifted = (T_a_b.translation() - measured.translation()).norm() / 0.006;
  return 0.5 * (turned * turned + shifted * shifted);
}

TEST(TrackedLinks, GiveTheGradientOfTheirCost) {
  const TrackingMap map = Linked();
  std::vector<QuadraticTerm> terms;
  AddTrackedLinks(map, terms);
  ASSERT_EQ(terms.size(), 1U);
  EXPECT_EQ(terms[0].keyframe_a, 0);
  EXPECT_EQ(terms[0].keyframe_b, 1);
  const Eigen::Matrix<double, 12, 1> gradient = terms[0].g.head<12>();
  ASSERT_GT(gradient.norm(), 1.0) << "nothing to compare";
  const double worst =
      Mismatch<1, 12>(gradient.transpose(), [&](const Eigen::Matrix<double, 12, 1>& step) {
        return Eigen::Matrix<double, 1, 1>(Cost(map, step.head<6>(), step.tail<6>()));
      });
  EXPECT_LT(worst, 0.01 * gradient.norm());
}

TEST(TrackedLinks, LeaveConstrainedKeyframesAlone) {
  TrackingMap map = synthetic::MakeTrueMap({.num_keyframes = 2}).map;
  map.keyframes[1].previous = 0;
  std::vector<QuadraticTerm> terms;
  AddTrackedLinks(map, terms);
  EXPECT_TRUE(terms.empty());
}

}  // namespace
}  // namespace plumb
