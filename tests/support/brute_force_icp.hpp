// SPDX-License-Identifier: Apache-2.0
// Algorithm 1 written down as it stands in the paper, with no data structure at all: the reference
// for RefinePoses().
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "algo/base/pose.hpp"

namespace plumb::testing {

struct BruteForceIcpResult {
  std::vector<Pose> T_refined_world;
  std::vector<double> rms_per_iteration;
};

/// Least-squares rigid transform by the SVD of the cross-covariance (Arun/Umeyama), apart from the
/// code under test.
inline Pose ArunFit(const std::vector<Eigen::Vector3d>& to,
                    const std::vector<Eigen::Vector3d>& from) {
  Eigen::Matrix3Xd a(3, static_cast<Eigen::Index>(to.size()));
  Eigen::Matrix3Xd b(3, static_cast<Eigen::Index>(from.size()));
  for (std::size_t i = 0; i < to.size(); ++i) {
    a.col(static_cast<Eigen::Index>(i)) = to[i];
    b.col(static_cast<Eigen::Index>(i)) = from[i];
  }
  Pose T;
  T.matrix() = Eigen::umeyama(b, a, false);
  return T;
}

/// Every pair of points is looked at. No subsampling: give it the points that take part.
inline BruteForceIcpResult BruteForceGlobalIcp(std::vector<std::vector<Eigen::Vector3d>> clouds,
                                               int num_iterations, double max_radius,
                                               double min_radius) {
  BruteForceIcpResult result;
  result.T_refined_world.assign(clouds.size(), Pose::Identity());
  const double step = (max_radius - min_radius) / num_iterations;
  double radius = max_radius;
  for (int iteration = 0; iteration < num_iterations; ++iteration) {
    double sum_squared = 0.0;
    std::size_t num_pairs = 0;
    std::vector<Pose> moves(clouds.size(), Pose::Identity());
    for (std::size_t j = 0; j < clouds.size(); ++j) {
      std::vector<Eigen::Vector3d> from;
      std::vector<Eigen::Vector3d> to;
      for (const Eigen::Vector3d& p : clouds[j]) {
        double nearest = std::numeric_limits<double>::max();
        Eigen::Vector3d partner = Eigen::Vector3d::Zero();
        for (std::size_t k = 0; k < clouds.size(); ++k) {
          if (k == j) continue;
          for (const Eigen::Vector3d& q : clouds[k]) {
            const double distance = (p - q).norm();
            if (distance < radius && distance < nearest) {
              nearest = distance;
              partner = q;
            }
          }
        }
        if (nearest == std::numeric_limits<double>::max()) continue;
        from.push_back(p);
        to.push_back(partner);
        sum_squared += nearest * nearest;
      }
      num_pairs += from.size();
      if (from.size() >= 3) moves[j] = ArunFit(to, from);
    }
    for (std::size_t j = 0; j < clouds.size(); ++j) {
      result.T_refined_world[j] = moves[j] * result.T_refined_world[j];
      for (Eigen::Vector3d& p : clouds[j]) p = moves[j] * p;
    }
    result.rms_per_iteration.push_back(
        num_pairs > 0 ? std::sqrt(sum_squared / static_cast<double>(num_pairs)) : 0.0);
    radius -= step;
  }
  return result;
}

}  // namespace plumb::testing
