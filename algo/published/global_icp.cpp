// SPDX-License-Identifier: Apache-2.0
#include "algo/published/global_icp.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "algo/geometry/neighbours.hpp"
#include "algo/geometry/rigid_fit.hpp"
#include "algo/published/poisson_disk.hpp"

namespace plumb {
namespace {

constexpr double kCellsPerSpacing =
    1.5;  // cell side over spacing; the fastest of 0.5, 1 and 1.5 as measured

using Points = std::vector<Eigen::Vector3f>;

void Check(std::span<const PointCloud> clouds, const GlobalIcpOptions& options) {
  if (options.num_iterations < 1)
    throw std::invalid_argument(fmt::format(
        "global ICP: number of iterations is {}, must be at least 1", options.num_iterations));
  if (!(options.min_radius > 0.0 && options.min_radius <= options.max_radius &&
        std::isfinite(options.max_radius)))
    throw std::invalid_argument(
        fmt::format("global ICP: radii must satisfy 0 < min ({} m) <= max ({} m)",
                    options.min_radius, options.max_radius));
  if (!(options.subsample_spacing >= 0.0 && std::isfinite(options.subsample_spacing)))
    throw std::invalid_argument(fmt::format("global ICP: subsample spacing {} m is not a distance",
                                            options.subsample_spacing));
  for (std::size_t j = 0; j < clouds.size(); ++j) {
    if (clouds[j].empty())
      throw std::invalid_argument(fmt::format("global ICP: cloud {} is empty", j));
  }
}

std::vector<Points> Subsample(std::span<const PointCloud> clouds, const GlobalIcpOptions& options) {
  std::vector<Points> subsampled(clouds.size());
  tbb::parallel_for(std::size_t{0}, clouds.size(), [&](std::size_t j) {
    try {
      const auto kept = PoissonDiskSubset(clouds[j].points, options.subsample_spacing,
                                          options.seed + static_cast<unsigned>(j));
      subsampled[j].reserve(kept.size());
      for (const std::uint32_t i : kept) subsampled[j].push_back(clouds[j].points[i]);
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(fmt::format("global ICP: cloud {}: {}", j, error.what()));
    }
  });
  return subsampled;
}

/// Cell size of the neighbour search. Several clouds overlap, so the points of other clouds are
/// nearer than those of the cloud itself.
double CellSize(const GlobalIcpOptions& options) {
  return options.subsample_spacing > 0.0 ? kCellsPerSpacing * options.subsample_spacing
                                         : options.min_radius;
}

/// The correspondences of one cloud in one iteration.
struct CloudStep {
  Pose T_new_old = Pose::Identity();
  double sum_squared = 0.0;
  int num_pairs = 0;
};

/// Correspondences of one cloud and the rigid fit to them.
class CloudMatcher {
 public:
  explicit CloudMatcher(std::size_t num_points) : memory_(num_points) {}

  CloudStep Step(std::size_t cloud, const CloudNeighbours& neighbours, const Points& points,
                 float radius) {
    from_.clear();
    to_.clear();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const std::uint32_t nearest = neighbours.Nearest(cloud, i, radius, memory_[i]);
      if (nearest == CloudNeighbours::kNone) continue;
      from_.push_back(points[i].cast<double>());
      to_.push_back(neighbours.point(nearest).cast<double>());
    }
    CloudStep step;
    step.num_pairs = static_cast<int>(from_.size());
    for (std::size_t k = 0; k < from_.size(); ++k)
      step.sum_squared += (from_[k] - to_[k]).squaredNorm();
    // identity where the pairs do not determine a transform
    step.T_new_old = FitRigid(to_, from_).T_a_b;
    return step;
  }

 private:
  std::vector<CloudNeighbours::Memory> memory_;
  std::vector<Eigen::Vector3d> from_;
  std::vector<Eigen::Vector3d> to_;
};

void MoveTo(const Pose& T_refined_world, const Points& original, Points& moved) {
  const Eigen::Matrix3d R = T_refined_world.linear();
  const Eigen::Vector3d t = T_refined_world.translation();
  for (std::size_t i = 0; i < original.size(); ++i)
    moved[i] = (R * original[i].cast<double>() + t).cast<float>();
}

}  // namespace

GlobalIcpResult RefinePoses(std::span<const PointCloud> clouds_in_world,
                            const GlobalIcpOptions& options, const std::stop_token& stop,
                            const std::function<void(double fraction)>& progress) {
  Check(clouds_in_world, options);
  const std::size_t num_clouds = clouds_in_world.size();
  GlobalIcpResult result;
  result.T_refined_world.assign(num_clouds, Pose::Identity());
  if (num_clouds == 0) return result;

  const std::vector<Points> original = Subsample(clouds_in_world, options);
  std::vector<Points> current = original;
  CloudNeighbours neighbours(current, CellSize(options));
  std::vector<CloudMatcher> matchers;
  matchers.reserve(num_clouds);
  for (const Points& points : original) matchers.emplace_back(points.size());

  const double radius_step = (options.max_radius - options.min_radius) / options.num_iterations;
  double radius = options.max_radius;
  std::vector<CloudStep> steps(num_clouds);
  for (int iteration = 0; iteration < options.num_iterations; ++iteration) {
    tbb::parallel_for(std::size_t{0}, num_clouds, [&](std::size_t j) {
      if (!stop.stop_requested())
        steps[j] = matchers[j].Step(j, neighbours, current[j], static_cast<float>(radius));
    });
    if (stop.stop_requested()) {
      result.cancelled = true;
      break;
    }
    tbb::parallel_for(std::size_t{0}, num_clouds, [&](std::size_t j) {
      result.T_refined_world[j] = steps[j].T_new_old * result.T_refined_world[j];
      MoveTo(result.T_refined_world[j], original[j], current[j]);
    });
    neighbours.Move(current);
    double sum_squared = 0.0;
    int num_pairs = 0;
    for (const CloudStep& step : steps) {
      sum_squared += step.sum_squared;
      num_pairs += step.num_pairs;
    }
    result.rms_per_iteration.push_back(num_pairs > 0 ? std::sqrt(sum_squared / num_pairs) : 0.0);
    radius -= radius_step;
    if (progress) progress(static_cast<double>(iteration + 1) / options.num_iterations);
  }
  return result;
}

}  // namespace plumb
