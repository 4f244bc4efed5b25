// SPDX-License-Identifier: Apache-2.0
#include "algo/motion/surface_patterns.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

#include <Eigen/Cholesky>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

// The least-squares line through a step of height 1 in the middle of [-1, 1] rises by this from the
// middle to the end: (1/2) / (2/3).
constexpr double kTiltOfHalf = 0.75;
constexpr int kNumPatterns = 5;
using Patterns = Eigen::Matrix<double, 1, kNumPatterns>;

}  // namespace

PatternMotions MotionsOfPatterns(const PointCloud& cloud,
                                 const std::function<bool(const Eigen::Vector3d&)>& in_region,
                                 const Pose& T_motion, const Eigen::Vector3d& moved_m) {
  constexpr std::size_t kStride = 7;
  std::vector<std::size_t> used;
  Eigen::Array2d sum = Eigen::Array2d::Zero(), squares = Eigen::Array2d::Zero();
  for (std::size_t i = 0; i < cloud.size(); i += kStride) {
    const Eigen::Vector3d p = cloud.points[i].cast<double>();
    if (!in_region(p)) continue;
    used.push_back(i);
    sum += p.head<2>().array();
    squares += p.head<2>().array().square();
  }
  const double count = std::max<double>(static_cast<double>(used.size()), 1.0);
  const Eigen::Array2d middle = sum / count;
  const Eigen::Array2d half =  // of an area that is covered evenly
      (3.0 * (squares / count - middle.square())).max(kMillimetre * kMillimetre).sqrt();
  Matrix6d information = Matrix6d::Zero();
  Eigen::Matrix<double, 6, kNumPatterns> right = Eigen::Matrix<double, 6, kNumPatterns>::Zero();
  for (const std::size_t i : used) {
    const Eigen::Vector3d p = cloud.points[i].cast<double>();
    const Eigen::Vector3d normal = T_motion.linear() * cloud.normals[i].cast<double>();
    Vector6d gradient;
    gradient << (T_motion * p - moved_m).cross(normal), normal;
    information += gradient * gradient.transpose();
    const Eigen::Array2d tilt = kTiltOfHalf * (p.head<2>().array() - middle) / half;
    Patterns out;
    out << 1.0, tilt.y(), tilt.x(), normal.z(), normal.z() * tilt.y();
    right += gradient * out;
  }
  // Directions that the surface does not determine stay where they are.
  information += 1e-6 * (1.0 + information.trace()) * Matrix6d::Identity();
  const auto solved = information.ldlt();
  const auto motion = [&](int pattern) -> Vector6d { return solved.solve(right.col(pattern)); };
  return {.out = motion(0),
          .out_along = motion(1),
          .out_across = motion(2),
          .up = motion(3),
          .up_along = motion(4)};
}

}  // namespace plumb
