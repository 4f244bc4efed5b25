// SPDX-License-Identifier: Apache-2.0
#include "algo/geometry/neighbours.hpp"

#include <limits>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

namespace plumb {
namespace {

using Clouds = std::vector<std::vector<Eigen::Vector3f>>;

Clouds RandomClouds(std::size_t count, std::size_t size, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(0.0F, 1.0F);
  Clouds clouds(count);
  // Flat clouds, each over its own stretch: some points have many others near, some none.
  for (std::size_t c = 0; c < count; ++c)
    for (std::size_t i = 0; i < size; ++i)
      clouds[c].emplace_back(0.4F * uniform(random) + 0.15F * static_cast<float>(c),
                             0.4F * uniform(random), 0.02F * uniform(random));
  return clouds;
}

std::uint32_t BruteForce(const Clouds& clouds, std::size_t cloud, std::size_t index, float radius) {
  float best = radius * radius;
  std::uint32_t nearest = CloudNeighbours::kNone;
  std::uint32_t global_index = 0;
  for (std::size_t c = 0; c < clouds.size(); ++c) {
    for (const Eigen::Vector3f& q : clouds[c]) {
      const float squared = (q - clouds[cloud][index]).squaredNorm();
      if (c != cloud && squared < best) {
        best = squared;
        nearest = global_index;
      }
      ++global_index;
    }
  }
  return nearest;
}

// The memory of earlier searches must never change an answer: clouds drift, jump, and the radius
// shrinks.
TEST(CloudNeighboursTest, EqualsBruteForceWhileCloudsMoveAndTheRadiusShrinks) {
  for (const double cell_size : {0.01, 0.03, 0.2}) {
    Clouds clouds = RandomClouds(4, 250, 3);
    CloudNeighbours neighbours(clouds, cell_size);
    std::vector<std::vector<CloudNeighbours::Memory>> memory(
        clouds.size(), std::vector<CloudNeighbours::Memory>(250));
    std::mt19937 random(7);
    std::normal_distribution<float> normal;
    int num_found = 0;
    int num_missing = 0;
    for (int iteration = 0; iteration < 14; ++iteration) {
      const float radius = 0.06F - 0.004F * static_cast<float>(iteration);
      for (std::size_t c = 0; c < clouds.size(); ++c) {
        for (std::size_t i = 0; i < clouds[c].size(); ++i) {
          const std::uint32_t found = neighbours.Nearest(c, i, radius, memory[c][i]);
          ASSERT_EQ(found, BruteForce(clouds, c, i, radius))
              << "iteration " << iteration << " cloud " << c << " point " << i;
          ++(found == CloudNeighbours::kNone ? num_missing : num_found);
        }
      }
      // Small steps, ever smaller ones towards the end, where old answers are reused most, and one
      // jump among them.
      const float step = iteration == 6 ? 0.03F : (iteration < 9 ? 0.0008F : 0.00005F);
      for (auto& cloud : clouds) {
        const Eigen::Vector3f shift =
            step * Eigen::Vector3f(normal(random), normal(random), normal(random));
        for (Eigen::Vector3f& p : cloud) p += shift;
      }
      neighbours.Move(clouds);
    }
    EXPECT_GT(num_found, 1000);
    EXPECT_GT(num_missing, 1000);
  }
}

TEST(CloudNeighboursTest, TheRadiusIsOpenAndTheOwnCloudDoesNotCount) {
  const Clouds clouds = {{{0, 0, 0}, {0.01F, 0, 0}}, {{0.5F, 0, 0}}};
  const CloudNeighbours neighbours(clouds, 0.02);
  CloudNeighbours::Memory memory;
  EXPECT_EQ(neighbours.Nearest(0, 0, 0.5F, memory), CloudNeighbours::kNone);
  EXPECT_EQ(neighbours.Nearest(0, 0, 0.5001F, memory), 2U);
  memory = {};
  EXPECT_EQ(neighbours.Nearest(1, 0, 1.0F, memory), 1U);
}

TEST(CloudNeighboursTest, NamesACallersMistake) {
  Clouds clouds = {{{0, 0, 0}}, {{1, 0, 0}}};
  EXPECT_THROW(CloudNeighbours(clouds, 0.0), std::invalid_argument);
  CloudNeighbours neighbours(clouds, 0.1);
  EXPECT_THROW(neighbours.Move(Clouds{{{0, 0, 0}}}), std::invalid_argument);
  clouds[1][0].x() = std::numeric_limits<float>::infinity();
  EXPECT_THROW(neighbours.Move(clouds), std::invalid_argument);
  EXPECT_THROW(CloudNeighbours(clouds, 0.1), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
