// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/world/distance_grid.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "drivers/simulator/suites/suite_plan.hpp"
#include "drivers/simulator/world/body.hpp"
#include "drivers/simulator/world/random.hpp"
#include "tests/unit/simulator/simulated_support.hpp"

namespace plumb::simulated {
namespace {

using Eigen::Vector3f;

TEST(DistanceGridTest, RaysMeetABallWhereGeometrySays) {
  const auto ball = Ball();
  RandomStream random(3);
  int hits = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vector3f origin(static_cast<float>(random.Within(0.3)),
                          static_cast<float>(random.Within(0.3)), 0.8F);
    const Vector3f target(static_cast<float>(random.Within(0.12)),
                          static_cast<float>(random.Within(0.12)),
                          static_cast<float>(random.Within(0.12)));
    const Vector3f direction = (target - origin).normalized();
    const float along = -origin.dot(direction);
    const float beside_squared = origin.squaredNorm() - along * along;
    const double radius = kBallRadius;
    const float t = ball->Intersect(origin, direction, 0.0F, 2.0F);
    if (beside_squared > (radius + 2e-4) * (radius + 2e-4)) {
      EXPECT_FALSE(std::isfinite(t));
    } else if (beside_squared < 0.9 * radius * radius) {
      ++hits;
      // Trilinear cells of 5 mm cut a ball of 0.1 m short by up to 3 h^2 / (8 r) = 0.09 mm; at this
      // incidence up to three times that along the ray.
      EXPECT_NEAR(t, along - std::sqrt(radius * radius - beside_squared), 3e-4);
    }
  }
  EXPECT_GT(hits, 1000);
}

TEST(DistanceGridTest, FourRaysAtOnceFindWhatEachFindsAlone) {
  const auto ball = Ball();
  RandomStream random(5);
  const auto within = [&](double limit) { return static_cast<float>(random.Within(limit)); };
  const auto set = [](Vector3x4& lanes, int i, const Vector3f& v) {
    lanes.x[i] = v.x();
    lanes.y[i] = v.y();
    lanes.z[i] = v.z();
  };
  int hits = 0;
  int misses = 0;
  for (int packet = 0; packet < 2000; ++packet) {
    Vector3x4 origins{};
    Vector3x4 directions{};
    Float4 begin{};
    Float4 end{};
    Float4 alone{};
    for (int i = 0; i < 4; ++i) {
      // Beside, grazing and through the ball; some from inside of the box, some that end before it.
      const Vector3f origin(within(0.3), within(0.3), random.Uniform() < 0.2 ? 0.11F : 0.8F);
      const Vector3f direction =
          (Vector3f(within(0.14), within(0.14), within(0.05)) - origin).normalized();
      set(origins, i, origin);
      set(directions, i, direction);
      begin[i] = static_cast<float>(random.Uniform(0.0, 0.1));
      end[i] = random.Uniform() < 0.2 ? 0.3F : 2.0F;
      alone[i] = ball->Intersect(origin, direction, begin[i], end[i]);
    }
    const Float4 together = ball->Intersect(origins, directions, begin, end);
    for (int i = 0; i < 4; ++i) {
      EXPECT_EQ(together[i], alone[i]);
      ++(std::isfinite(together[i]) ? hits : misses);
    }
  }
  EXPECT_GT(hits, 1000);
  EXPECT_GT(misses, 1000);
}

TEST(DistanceGridTest, NormalsPointAwayFromABallsCentre) {
  const auto ball = Ball();
  for (int i = 0; i < 200; ++i) {
    const float angle = 0.1F * static_cast<float>(i);
    const Vector3f direction =
        Vector3f(std::cos(angle), std::sin(angle), std::cos(2.7F * angle)).normalized();
    // Measured: at most 0.3 degrees.
    EXPECT_GT(ball->Normal(static_cast<float>(kBallRadius) * direction).dot(direction),
              std::cos(0.6F * 0.01745F));
  }
}

TEST(DistanceGridTest, AConeNeverStepsOverTheSurface) {
  const auto ball = Ball();
  RandomStream random(4);
  for (int i = 0; i < 2000; ++i) {
    const Vector3f origin(static_cast<float>(random.Within(0.3)),
                          static_cast<float>(random.Within(0.3)), 0.8F);
    const Vector3f axis = (Vector3f(static_cast<float>(random.Within(0.2)),
                                    static_cast<float>(random.Within(0.2)), 0) -
                           origin)
                              .normalized();
    const float start = ball->ConeStart(origin, axis, 0.02F, 0.002F, 3.0F);
    const Vector3f inside = (axis + 0.0135F * Vector3f(static_cast<float>(random.Within(1)),
                                                       static_cast<float>(random.Within(1)), 0))
                                .normalized();
    const float t = ball->Intersect(origin, inside, 0.0F, 3.0F);
    EXPECT_TRUE(!std::isfinite(t) || start <= t);
  }
}

class BodySurfaceTest : public testing::TestWithParam<BodyKind> {};

TEST_P(BodySurfaceTest, IsAClosedMeshOnTheZeroSet) {
  const auto body = MakeBody({.kind = GetParam()});
  ASSERT_GT(body->surface.vertices.size(), 10000U);
  float worst = 0;
  for (const Vector3f& vertex : body->surface.vertices)
    worst = std::max(worst, std::abs(body->grid->Distance(vertex)));
  EXPECT_LT(worst, 1e-4F);  // Measured 3e-6.

  // Closed and consistently oriented: every directed edge has its opposite.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> opposites;
  double volume = 0;
  for (const auto& triangle : body->surface.triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      edges.emplace_back(triangle[i], triangle[(i + 1) % 3]);
      opposites.emplace_back(triangle[(i + 1) % 3], triangle[i]);
    }
    const auto at = [&](std::size_t i) {
      return body->surface.vertices[triangle[i]].cast<double>();
    };
    volume +=
        Eigen::Vector3d(at(0)).dot(Eigen::Vector3d(at(1)).cross(Eigen::Vector3d(at(2)))) / 6.0;
  }
  std::sort(edges.begin(), edges.end());
  std::sort(opposites.begin(), opposites.end());
  EXPECT_TRUE(edges == opposites);
  // Outward orientation gives a positive volume: litres of a mannequin's torso, of a slim adult.
  EXPECT_GT(volume, GetParam() == BodyKind::kTorso ? 0.015 : 0.030);
  EXPECT_LT(volume, GetParam() == BodyKind::kTorso ? 0.050 : 0.090);
}

INSTANTIATE_TEST_SUITE_P(Kinds, BodySurfaceTest,
                         testing::Values(BodyKind::kTorso, BodyKind::kFullBody));

TEST(BodyTest, DeformationsMoveWhatTheyNameAndLeaveTheRest) {
  const BodyShape relaxed{.kind = BodyKind::kFullBody};
  BodyShape belly = relaxed;
  belly.belly_rise_m = 0.015;
  const auto top = [](const BodyShape& shape, double x, double y) {
    double z = 0.4;
    while (z > 0 && BodyImplicit(shape, {x, y, z}) > 0) z -= 1e-4;
    return z;
  };
  EXPECT_NEAR(top(belly, 0.10, 0.03) - top(relaxed, 0.10, 0.03), 0.015, 0.004);  // Measured 0.0148.
  EXPECT_NEAR(top(belly, -0.30, 0.03), top(relaxed, -0.30, 0.03), 1e-4);
  BodyShape arm = relaxed;
  arm.right_arm_abduction_rad = 0.15;
  // The right hand leaves its place, the left one stays.
  EXPECT_LT(BodyImplicit(relaxed, {0.33, -0.295, 0.045}), 0.0);
  EXPECT_GT(BodyImplicit(arm, {0.33, -0.295, 0.045}), 0.02);
  EXPECT_EQ(BodyImplicit(arm, {0.33, 0.30, 0.045}), BodyImplicit(relaxed, {0.33, 0.30, 0.045}));
}

}  // namespace
}  // namespace plumb::simulated
