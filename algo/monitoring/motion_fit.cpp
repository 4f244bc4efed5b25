// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/motion_fit.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "algo/base/statistics.hpp"
#include "algo/base/units.hpp"

namespace plumb {
namespace {

using Matrix8d = Eigen::Matrix<double, 8, 8>;
using Vector8d = Eigen::Matrix<double, 8, 1>;
using Matrix62d = Eigen::Matrix<double, 6, 2>;
using Eigen::Vector3d;

constexpr int kMostIterations = 12;
constexpr double kLastGate_m = 8 * kMillimetre;
constexpr double kHuber = 1.5;                     // sigmas
constexpr double kConverged = 0.03 * kMillimetre;  // m, and rad at 1 m

// Blocks that change their partners to and fro at the end are no reason for doubt.
constexpr double kAlmost = 0.2 * kMillimetre;

// Of one sensor: motion, then the sizes of its two patterns.
struct Equations {
  Matrix8d left = Matrix8d::Zero();
  Vector8d right = Vector8d::Zero();
  std::vector<float> residuals;  // |residual| / sigma

  // What is assumed of the patterns.
  void Assume(const Eigen::Vector2d& sigmas_m, const Eigen::Vector2d& modes_m) {
    const Eigen::Vector2d weights = sigmas_m.cwiseProduct(sigmas_m).cwiseInverse();
    left.diagonal().tail<2>() += weights;
    right.tail<2>() -= weights.cwiseProduct(modes_m);
  }
  // The equations of the motion alone: whatever the patterns' sizes are.
  void AddMotion(Matrix6d& motion_left, Vector6d& motion_right) const {
    const Matrix62d shared = left.topRightCorner<6, 2>() * Inverse();
    motion_left += left.topLeftCorner<6, 6>() - shared * left.bottomLeftCorner<2, 6>();
    motion_right += right.head<6>() - shared * right.tail<2>();
  }
  [[nodiscard]] Eigen::Vector2d ModeStep(const Vector6d& step) const {
    return Inverse() * (right.tail<2>() - left.bottomLeftCorner<2, 6>() * step);
  }

 private:
  [[nodiscard]] Eigen::Matrix2d Inverse() const { return left.bottomRightCorner<2, 2>().inverse(); }
};

// A sensor's measured blocks, in the scene.
std::vector<Vector3d> MeasuredBy(const FitView& view) {
  std::vector<Vector3d> measured;
  for (std::size_t i = 0; i < view.grid.size(); ++i) {
    if (const auto point = MeasuredPoint(view, i)) measured.push_back(*point);
  }
  return measured;
}

Equations EquationsOf(const FitView& view, const std::vector<Vector3d>& measured, const Pose& T,
                      const Eigen::Vector2d& modes_m, const Vector3d& moved_centroid,
                      double gate_m) {
  Equations equations;
  const Pose T_model_scene = T.inverse();
  const Eigen::Matrix3d R = T.linear();
  const Pose T_camera_scene = view.T_scene_camera.inverse();
  for (const Vector3d& p : measured) {
    const Vector3d back = T_model_scene * p;
    const auto block = view.grid.BlockOf(T_camera_scene * back);
    if (!block || view.model.part[*block] != SurfacePart::kRegion) continue;
    const Vector3d n = view.model.normal[*block].cast<double>();
    Vector8d row = Vector8d::Zero();
    for (std::size_t m = 0; m < 2; ++m) {
      if (view.modes[m] != nullptr)
        row[static_cast<Eigen::Index>(6 + m)] = (*view.modes[m])[*block];
    }
    const double residual = n.dot(back - view.model.point[*block].cast<double>()) -
                            row.tail<2>().dot(modes_m - view.modes_of_model_m);
    if (!(std::abs(residual) <= gate_m)) continue;
    const double sigma = view.model.sigma_m[*block];
    const double in_sigmas = std::abs(residual) / sigma;
    const double weight = (in_sigmas <= kHuber ? 1.0 : kHuber / in_sigmas) / (sigma * sigma);
    const Vector3d turned = R * n;
    row.head<3>() = (p - moved_centroid).cross(turned);
    row.segment<3>(3) = turned;
    equations.left.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
    equations.right += weight * residual * row;
    equations.residuals.push_back(static_cast<float>(in_sigmas));
  }
  equations.left = Matrix8d(equations.left.selfadjointView<Eigen::Lower>());
  return equations;
}

}  // namespace

std::optional<Vector3d> MeasuredPoint(const FitView& view, std::size_t block) {
  float inverse = view.image.inverse_depth[block];
  if (view.correction != nullptr) inverse *= (*view.correction)[block];
  if (inverse <= 0) return std::nullopt;
  const double z = 1.0 / (static_cast<double>(inverse) * view.drift);
  const Eigen::Vector2f& ray = view.image.ray[block];
  return view.T_scene_camera * Vector3d(ray.x() * z, ray.y() * z, z);
}

double MotionFit::visible() const {
  double used = 0, expected = 0;
  for (const ViewFit& view : views) {
    used += view.num_used;
    expected += view.num_expected;
  }
  return expected > 0 ? used / expected : 0;
}

MotionFit FitMotion(std::span<const FitView> views, const Vector3d& centroid,
                    const FitStart& start) {
  MotionFit fit{.T = start.T};
  std::vector<std::vector<Vector3d>> measured;
  for (const FitView& view : views) {
    measured.push_back(MeasuredBy(view));
    fit.views.push_back(
        {.modes_m = view.modes_m,
         .num_expected = static_cast<double>(view.model.CountOf(SurfacePart::kRegion))});
  }
  double gate_m = std::max(start.gate_m, kLastGate_m);
  for (int iteration = 0; iteration < kMostIterations; ++iteration) {
    const Vector3d moved = fit.T * centroid;
    std::vector<Equations> equations;
    fit.information.setZero();
    Vector6d right = Vector6d::Zero();
    int num_used = 0;
    for (std::size_t i = 0; i < views.size(); ++i) {
      ViewFit& one = fit.views[i];
      Equations& of_view = equations.emplace_back(
          EquationsOf(views[i], measured[i], fit.T, one.modes_m, moved, gate_m));
      one.num_used = static_cast<int>(of_view.residuals.size());
      one.residual = of_view.residuals.empty() ? 0.0 : TakeMedian(of_view.residuals);
      num_used += one.num_used;
      of_view.Assume(views[i].mode_sigmas_m, one.modes_m);
      of_view.AddMotion(fit.information, right);
    }
    constexpr int kLeastBlocks = 50;
    if (num_used < kLeastBlocks) return fit;
    // Directions that nothing determines stay where they are.
    const Matrix6d left = fit.information + Matrix6d::Identity();
    const Vector6d step = left.ldlt().solve(right);
    if (!step.allFinite()) return fit;
    fit.T = PoseAbout(moved, step) * fit.T;
    double squares = step.squaredNorm();
    for (std::size_t i = 0; i < views.size(); ++i) {
      const Eigen::Vector2d of_modes = equations[i].ModeStep(step);
      fit.views[i].modes_m += of_modes;
      squares += of_modes.squaredNorm();
    }
    fit.converged = gate_m <= kLastGate_m && std::sqrt(squares) < kAlmost;
    if (gate_m <= kLastGate_m && std::sqrt(squares) < kConverged) break;
    constexpr double kShrink = 0.4;
    gate_m = std::max(kLastGate_m, kShrink * gate_m);
  }
  fit.T = Orthonormalised(fit.T);
  return fit;
}

}  // namespace plumb
