// SPDX-License-Identifier: Apache-2.0
#include "algo/tracking/pose_optimizer.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "algo/base/robust_weights.hpp"
#include "algo/tracking/view_geometry.hpp"

namespace plumb {
namespace {

// Residuals in sigmas above which a point is an outlier, in the image and along the ray. Depth may
// be wrong by more: beside an edge it belongs to another surface. Measured on the first 44 images
// of the real Kinect: 1.5 and 6 sigmas for the image make the path's error 4.4 and 8.6 mm instead
// of 6.4, and 37 and 22 keyframes of 28.
constexpr double kPointGate = 3.0;
constexpr double kDepthGate = 6.0;

// Distance of two surfaces up to which their cells belong together: at the first iteration what a
// wrong prediction leaves, then less and less, to what noise and the depth image's errors explain.
// Both halved 7.3, both doubled 6.2 instead of 6.4 mm on those images.
constexpr double kFirstGate_m = 0.08;
constexpr double kLastGate_m = 0.02;
constexpr double kGateShrinking = 0.7;

// Added to the noise of two depth measurements: the depth image's systematic errors, which the
// tracker does not estimate. None 5.8, double 7.8 instead of 6.4 mm on those images.
constexpr double kSurfaceError_m = 0.002;

// Slight damping keeps unconstrained directions at the prediction.
constexpr double kDamping = 1e-3;
constexpr double kRelativeDamping = 1e-6;
constexpr double kConvergedStep = 1e-5;  // Radians and metres.

// Normal equations of a twist applied on the camera's side: T <- T * PoseFromTwist(x).
struct NormalEquations {
  Matrix6d H = Matrix6d::Zero();
  Vector6d g = Vector6d::Zero();

  // Only the lower half of H is filled and used.
  void Add(const Vector6d& J, double residual, double weight) {
    for (int column = 0; column < 6; ++column)
      for (int row = column; row < 6; ++row) H(row, column) += weight * J[row] * J[column];
    g.noalias() += weight * residual * J;
  }
};

constexpr double kLossScale = 2.0;  // Cauchy scale in standard deviations.

double WeightOf(double residual_in_sigmas) {
  return CauchyWeight(residual_in_sigmas * residual_in_sigmas, kLossScale);
}

// With p_camera = T^-1 p_world and T <- T exp(x): d p_camera / d x = [ [p]x , -I ].
void AddPoint(const PosePoint& point, const Eigen::Vector3d& p, NormalEquations& equations) {
  if (p.z() < kNearestInView_m) return;
  const double iz = 1.0 / p.z();
  const Eigen::Vector2d residual = (p.head<2>() * iz - point.ideal) / point.sigma;
  const double weight = WeightOf(residual.norm());
  Eigen::Matrix<double, 3, 6> J_point;
  J_point << Skew(p), -Eigen::Matrix3d::Identity();
  const Vector6d Jx =
      (J_point.row(0) - p.x() * iz * J_point.row(2)).transpose() * (iz / point.sigma);
  const Vector6d Jy =
      (J_point.row(1) - p.y() * iz * J_point.row(2)).transpose() * (iz / point.sigma);
  equations.Add(Jx, residual.x(), weight);
  equations.Add(Jy, residual.y(), weight);
  if (point.inverse_z > 0) {
    const double depth_residual = (iz - point.inverse_z) / point.inverse_z_sigma;
    const Vector6d Jz = -iz * iz / point.inverse_z_sigma * J_point.row(2).transpose();
    equations.Add(Jz, depth_residual, weight * WeightOf(depth_residual));
  }
}

struct DenseSum {
  NormalEquations equations;
  double squares = 0;
  int associated = 0;
  int valid = 0;
};

// Cosine of incidence for the target's cells, computed on first use.
using GrazingOfCells = std::vector<double>;
constexpr double kNotComputed = -1.0;  // Not a cosine of incidence, which is never negative.

double GrazingOf(const DenseView& target, std::size_t cell, GrazingOfCells& known) {
  double& grazing = known[cell];
  if (grazing == kNotComputed)
    grazing = Grazing(std::abs(target.normals[cell].dot(target.point(cell).normalized())));
  return grazing;
}

// A cell of the frame, in both of its cameras.
struct DensePoint {
  Eigen::Vector3f p_depth;
  Eigen::Vector3d p_color;
};

// The points of a frame's cells, in the order of the cells, in which the sums are formed.
std::vector<DensePoint> DensePoints(const PoseProblem& problem) {
  std::vector<DensePoint> points;
  const DenseView& frame = *problem.dense_frame;
  points.reserve(frame.size() / (kPoseStride * kPoseStride));
  for (int r = 0; r < frame.height; r += kPoseStride) {
    for (int c = 0; c < frame.width; c += kPoseStride) {
      const auto i = static_cast<std::size_t>(r * frame.width + c);
      if (frame.z_m[i] <= 0) continue;
      const Eigen::Vector3f p = frame.point(i);
      points.push_back({p, problem.T_color_depth * p.cast<double>()});
    }
  }
  return points;
}

DenseSum AddDense(const PoseProblem& problem, const std::vector<DensePoint>& points,
                  const Pose& T_world_camera, double gate_m, GrazingOfCells& grazing_of_cells) {
  DenseSum sum;
  sum.valid = static_cast<int>(points.size());
  const DenseView& target = *problem.dense_target;
  const Pose T_target_depth =
      problem.T_world_target.inverse() * T_world_camera * problem.T_color_depth;
  const Pose T_depth_color = problem.T_color_depth.inverse();
  const Eigen::Matrix3f R = T_target_depth.linear().cast<float>();
  const Eigen::Vector3f t = T_target_depth.translation().cast<float>();
  const Eigen::Matrix3d R_target_color = (T_target_depth * T_depth_color).linear();
  const double window = target.window_px;
  for (const DensePoint& point : points) {
    const Eigen::Vector3f q = R * point.p_depth + t;
    if (q.z() < static_cast<float>(kNearestInView_m)) continue;
    const Eigen::Vector2d pixel = Project(problem.intrinsics, q.cast<double>());
    // Rounded towards zero, so that what lies less than one cell outside is found out here.
    const double across = (pixel.x() + 0.5) / window;
    const double down = (pixel.y() + 0.5) / window;
    if (!(across >= 0 && down >= 0 && across < target.width && down < target.height)) continue;
    const auto j =
        static_cast<std::size_t>(static_cast<int>(down) * target.width + static_cast<int>(across));
    const Eigen::Vector3f& n = target.normals[j];
    if (n.isZero()) continue;
    const double residual = n.dot(q - target.point(j));
    if (std::abs(residual) > gate_m) continue;
    const double sigma =
        std::sqrt(2.0) * problem.depth_noise.Sigma_m(static_cast<double>(q.z()),
                                                     GrazingOf(target, j, grazing_of_cells)) +
        kSurfaceError_m;
    // The motion is on the colour camera's side: q = T_target_color * exp(x) * p_color.
    const Eigen::Vector3d n_color = R_target_color.transpose() * n.cast<double>();
    Vector6d J;
    J << point.p_color.cross(n_color), n_color;
    sum.equations.Add(J / sigma, residual / sigma, WeightOf(residual / sigma));
    sum.squares += residual * residual;
    ++sum.associated;
  }
  return sum;
}

}  // namespace

PoseEstimate OptimizePose(const PoseProblem& problem, const Pose& T_world_camera_start) {
  PoseEstimate estimate;
  estimate.T_world_camera = T_world_camera_start;
  const bool dense = problem.dense_frame != nullptr && problem.dense_target != nullptr;
  GrazingOfCells grazing_of_cells(dense ? problem.dense_target->size() : 0, kNotComputed);
  const std::vector<DensePoint> dense_points =
      dense ? DensePoints(problem) : std::vector<DensePoint>();
  double gate_m = kFirstGate_m;
  for (int iteration = 0; iteration < problem.num_iterations; ++iteration) {
    NormalEquations equations;
    const Pose T_camera_world = estimate.T_world_camera.inverse();
    for (const PosePoint& point : problem.points)
      AddPoint(point, T_camera_world * point.p_world, equations);
    if (dense) {
      const DenseSum sum =
          AddDense(problem, dense_points, estimate.T_world_camera, gate_m, grazing_of_cells);
      equations.H += sum.equations.H;
      equations.g += sum.equations.g;
      estimate.num_dense = sum.associated;
      estimate.dense_overlap =
          sum.valid > 0 ? static_cast<double>(sum.associated) / sum.valid : 0.0;
      estimate.dense_rms_m = sum.associated > 0 ? std::sqrt(sum.squares / sum.associated) : 0.0;
      gate_m = std::max(kLastGate_m, gate_m * kGateShrinking);
    }
    estimate.information = equations.H.selfadjointView<Eigen::Lower>();
    Matrix6d damped = equations.H;
    damped.diagonal().array() += kDamping + kRelativeDamping * equations.H.diagonal().array();
    const Vector6d step = -damped.ldlt().solve(equations.g);
    if (!step.allFinite()) return estimate;
    estimate.T_world_camera = estimate.T_world_camera * PoseFromTwist(step);
    if (step.head<3>().norm() < kConvergedStep && step.tail<3>().norm() < kConvergedStep) {
      estimate.converged = true;
      break;
    }
  }
  estimate.T_world_camera = Orthonormalised(estimate.T_world_camera);
  const Pose T_camera_world = estimate.T_world_camera.inverse();
  estimate.inlier.resize(problem.points.size());
  for (std::size_t i = 0; i < problem.points.size(); ++i) {
    const PosePoint& point = problem.points[i];
    const Eigen::Vector3d p = T_camera_world * point.p_world;
    bool inlier = p.z() > kNearestInView_m &&
                  (p.head<2>() / p.z() - point.ideal).norm() < kPointGate * point.sigma;
    if (inlier && point.inverse_z > 0)
      inlier = std::abs(1.0 / p.z() - point.inverse_z) < kDepthGate * point.inverse_z_sigma;
    estimate.inlier[i] = inlier;
    estimate.num_inliers += inlier ? 1 : 0;
  }
  return estimate;
}

}  // namespace plumb
