// SPDX-License-Identifier: Apache-2.0
#include "algo/motion/deformation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <vector>

#include <gtest/gtest.h>

#include "algo/motion/surface.hpp"
#include "tests/support/synthetic_scene.hpp"

namespace plumb {
namespace {

using test::BodyMotionAbout;
using test::BodyShape;
using test::SyntheticOptions;

/// Two scans of a body, the second one moved rigidly and then deformed.
struct Pair {
  Pose T_motion;
  Pose T_reference_body;
  std::optional<Deformation> deformation;
};

Pair Registered(BodyShape shape,
                const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& deform,
                double noise_m = 0.0007) {
  SyntheticOptions reference;
  reference.shape = shape;
  reference.noise_m = noise_m;
  reference.T_reference_body = Eigen::Translation3d(0.1, 0.5, 0.0) * Pose::Identity();
  const Eigen::Vector3d centroid = reference.T_reference_body * test::BodyCentroid(shape);
  Pair pair{.T_motion = BodyMotionAbout(centroid, {0.02, 0.03, 0}, -8),
            .T_reference_body = reference.T_reference_body,
            .deformation = {}};
  SyntheticOptions current = reference;
  current.seed = 2;
  current.T_reference_body = pair.T_motion * reference.T_reference_body;
  current.deform = deform;
  const Scene before = test::MakeSyntheticScene(reference), now = test::MakeSyntheticScene(current);
  const auto body = [](const Scene& scene) {
    return FindBody(MakeSurface(scene.cloud, 0.01, 0.03));
  };
  const Body body_before = body(before), body_now = body(now);
  pair.deformation = EstimateDeformation({.reference_cloud = before.cloud,
                                          .reference_body = body_before,
                                          .current_cloud = now.cloud,
                                          .current_body = body_now,
                                          .T_motion = pair.T_motion});
  return pair;
}

/// Median distance of the estimated displacements from the true ones, where `keep` accepts a place
/// in the body's frame.
double MedianError_mm(const Pair& pair,
                      const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& truth,
                      const std::function<bool(const Eigen::Vector3d&)>& keep) {
  std::vector<double> errors;
  for (std::size_t i = 0; i < pair.deformation->points.size(); ++i) {
    const Eigen::Vector3d p_body =
        pair.T_reference_body.inverse() * pair.deformation->points[i].cast<double>();
    if (pair.deformation->observed[i] == 0 || !keep(p_body)) continue;
    const Eigen::Vector3d shift = pair.T_reference_body.linear() * truth(p_body);
    errors.push_back((pair.deformation->shifts_m[i].cast<double>() - shift).norm() * 1000);
  }
  EXPECT_GT(errors.size(), 40U);
  std::sort(errors.begin(), errors.end());
  return errors.empty() ? 1e9 : errors[errors.size() / 2];
}

bool Everywhere(const Eigen::Vector3d& p) { return p.allFinite(); }

TEST(DeformationTest, ABodyThatOnlyMovedRigidlyIsNotDeformed) {
  const auto none = [](const Eigen::Vector3d&) { return Eigen::Vector3d::Zero().eval(); };
  const Pair pair = Registered(BodyShape::kTorso, none);
  ASSERT_TRUE(pair.deformation);
  EXPECT_LT(MedianError_mm(pair, none, Everywhere), 0.35);  // measured 0.28
  EXPECT_LT(pair.deformation->shift_p95_m, 2e-3);
}

TEST(DeformationTest, ARisenBellyIsMeasuredAndTheChestStaysWhereItIs) {
  const auto belly = [](const Eigen::Vector3d& p) {
    return Eigen::Vector3d(
        0, 0,
        0.015 * std::exp(-0.5 * (std::pow((p.x() + 0.12) / 0.06, 2) + std::pow(p.y() / 0.07, 2))));
  };
  const Pair pair = Registered(BodyShape::kTorso, belly);
  ASSERT_TRUE(pair.deformation);
  const auto top = [](const Eigen::Vector3d& p) {
    return std::abs(p.x() + 0.12) < 0.03 && std::abs(p.y()) < 0.04;
  };
  const auto chest = [](const Eigen::Vector3d& p) { return p.x() > 0.12; };
  // Two thirds of it along the surface, where nothing is measured. Measured 1.5 and 0.5.
  EXPECT_LT(MedianError_mm(pair, belly, top), 1.8);
  EXPECT_LT(MedianError_mm(pair, belly, chest), 0.6);
}

}  // namespace
}  // namespace plumb
