// SPDX-License-Identifier: Apache-2.0
#include "daemon/evaluation/accuracy.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>

#include "algo/base/statistics.hpp"
#include "algo/base/units.hpp"
#include "algo/geometry/rigid_fit.hpp"

namespace plumb {
namespace {

double Quantile(const std::vector<double>& sorted, double q) {
  const double rank = q * static_cast<double>(sorted.size() - 1);
  const auto low = static_cast<std::size_t>(rank);
  const std::size_t high = std::min(low + 1, sorted.size() - 1);
  return sorted[low] + (rank - static_cast<double>(low)) * (sorted[high] - sorted[low]);
}

double InMillimetres(double metres) { return metres / kMillimetre; }

/// Differences estimate - truth and their cells.
HeightError SummariseHeights(std::vector<double> differences_m, std::size_t num_true) {
  HeightError error;
  error.count = differences_m.size();
  if (num_true > 0)
    error.completeness = static_cast<double>(error.count) / static_cast<double>(num_true);
  if (differences_m.empty()) return error;
  std::sort(differences_m.begin(), differences_m.end());
  error.bias_mm = InMillimetres(Quantile(differences_m, 0.5));
  for (double& d : differences_m) d = std::abs(d);
  const ErrorSummary summary = Summarise(std::move(differences_m));
  error.median_abs_mm = InMillimetres(summary.median);
  error.rmse_mm = InMillimetres(summary.rms);
  error.p95_mm = InMillimetres(summary.p95);
  return error;
}

}  // namespace

ErrorSummary Summarise(std::vector<double> values) {
  ErrorSummary summary;
  if (values.empty()) return summary;
  std::sort(values.begin(), values.end());
  const auto n = static_cast<double>(values.size());
  summary.count = values.size();
  summary.mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
  summary.rms =
      std::sqrt(std::inner_product(values.begin(), values.end(), values.begin(), 0.0) / n);
  summary.median = Quantile(values, 0.5);
  summary.p95 = Quantile(values, 0.95);
  summary.max = values.back();
  return summary;
}

Pose TrueMotion(const SceneTruth& reference, const SceneTruth& current) {
  const Pose& T_world_marker = reference.T_world_reference_marker;
  return T_world_marker.inverse() * current.T_world_body * reference.T_world_body.inverse() *
         T_world_marker;
}

MotionError ErrorOfMotion(const Pose& estimated_motion, const SceneTruth& reference,
                          const SceneTruth& current) {
  const Pose true_motion = TrueMotion(reference, current);
  const Eigen::Vector3d centroid =
      reference.T_world_reference_marker.inverse() * reference.centroid_world();
  return {.rotation_deg = RotationAngle(estimated_motion.inverse() * true_motion) / kDegree,
          .translation_mm =
              InMillimetres((estimated_motion * centroid - true_motion * centroid).norm())};
}

std::optional<TrajectoryError> ErrorOfTrajectory(std::span<const StampedPose> trajectory,
                                                 const SceneTruth& truth) {
  std::vector<Eigen::Vector3d> estimated, in_truth;
  std::vector<Pose> T_scene_camera, T_world_camera;
  for (const StampedPose& pose : trajectory) {
    const std::optional<Pose> true_pose = TruePoseAt(truth.trajectory, pose.time_s);
    if (!true_pose) continue;
    T_scene_camera.push_back(pose.T_world_camera);
    T_world_camera.push_back(*true_pose);
    estimated.push_back(pose.T_world_camera.translation());
    in_truth.push_back(true_pose->translation());
  }
  if (estimated.size() < 3) return std::nullopt;
  const RigidFit fit = FitRigid(in_truth, estimated);
  if (!fit.valid) return std::nullopt;

  TrajectoryError error{.count = estimated.size(), .T_world_scene = fit.T_a_b};
  std::vector<double> distances_m, angles_deg;
  for (std::size_t i = 0; i < estimated.size(); ++i) {
    distances_m.push_back((fit.T_a_b * estimated[i] - in_truth[i]).norm());
    angles_deg.push_back(
        RotationAngle(T_world_camera[i].inverse() * fit.T_a_b * T_scene_camera[i]) / kDegree);
  }
  const ErrorSummary summary = Summarise(distances_m);
  error.rmse_mm = InMillimetres(summary.rms);
  error.median_mm = InMillimetres(summary.median);
  error.max_mm = InMillimetres(summary.max);
  error.rotation_rmse_deg = Summarise(angles_deg).rms;
  const Pose estimated_step = T_scene_camera.front().inverse() * T_scene_camera.back();
  const Pose true_step = T_world_camera.front().inverse() * T_world_camera.back();
  error.drift_mm = InMillimetres((true_step.inverse() * estimated_step).translation().norm());
  return error;
}

AlignmentError ErrorOfAlignment(const Pose& T_reference_current, const SceneTruth& reference,
                                const SceneTruth& current, const Pose& T_world_reference_scene,
                                const Pose& T_world_current_scene) {
  const auto figures = [&](const Pose& T_world_a, const Pose& T_world_b) {
    // A true point of the current scene, in the current scene's frame, transformed by the alignment
    // and back into the world.
    const Pose T_error = T_world_a * T_reference_current * T_world_b.inverse();
    std::vector<double> distances_m;
    for (const auto& [id, corners] : current.markers) {
      if (!reference.markers.contains(id)) continue;
      for (const Eigen::Vector3d& corner : corners)
        distances_m.push_back((T_error * corner - corner).norm());
    }
    const Eigen::Vector3d centroid = current.centroid_world();
    return AlignmentError::Figures{
        .corners_mm = InMillimetres(Summarise(distances_m).rms),
        .body_mm = InMillimetres((T_error * centroid - centroid).norm())};
  };
  return {.in_true_frames =
              figures(reference.T_world_reference_marker, current.T_world_reference_marker),
          .in_own_frames = figures(T_world_reference_scene, T_world_current_scene)};
}

IntervalCount CoverageOfMarkers(const MarkerMap& estimated, const SceneTruth& truth) {
  std::vector<Eigen::Vector3d> in_scene, in_truth;
  std::vector<double> sigmas_m, weights;
  for (const auto& [id, marker] : estimated) {
    const auto found = truth.markers.find(id);
    if (found == truth.markers.end() || !(marker.sigma_m > 0)) continue;
    in_scene.insert(in_scene.end(), marker.corners.begin(), marker.corners.end());
    in_truth.insert(in_truth.end(), found->second.begin(), found->second.end());
    sigmas_m.insert(sigmas_m.end(), marker.corners.size(), marker.sigma_m);
    weights.insert(weights.end(), marker.corners.size(), 1.0 / (marker.sigma_m * marker.sigma_m));
  }
  IntervalCount count;
  const RigidFit fit = FitRigid(in_scene, in_truth, weights);
  if (!fit.valid) return count;
  for (std::size_t i = 0; i < in_scene.size(); ++i) {
    const Eigen::Vector3d off = in_scene[i] - fit.T_a_b * in_truth[i];
    count.count += 3;
    count.inside += static_cast<std::size_t>((off.array().abs() <= kCover95 * sigmas_m[i]).count());
  }
  return count;
}

HeightMap TrueHeights(const SceneTruth& truth, const GridShape& grid, const Pose& T_world_frame,
                      double min_frames_seen) {
  const Pose T_frame_world = T_world_frame.inverse();
  std::vector<Eigen::Vector3d> vertices;
  vertices.reserve(truth.body.vertices_world.size());
  for (const Eigen::Vector3d& p_world : truth.body.vertices_world)
    vertices.push_back(T_frame_world * p_world);

  // The highest triangle determines a cell, seen or not: a hidden part above must not uncover the
  // part below it.
  HeightMap heights(grid);
  std::vector<char> hidden(grid.num_cells(), 0);
  for (const auto& [i, j, k] : truth.body.triangles) {
    const Eigen::Vector3d &a = vertices[i], &b = vertices[j], &c = vertices[k];
    const double area = (b.x() - a.x()) * (c.y() - a.y()) - (c.x() - a.x()) * (b.y() - a.y());
    if (std::abs(area) < 1e-14) continue;
    const auto& seen = truth.body.frames_seen;
    const bool is_hidden = std::min({seen[i], seen[j], seen[k]}) < min_frames_seen;
    const auto first = [](double low, double min, double step) {
      return std::max(0, static_cast<int>(std::ceil((low - min) / step - 0.5)));
    };
    const auto last = [](double high, double min, double step, int size) {
      return std::min(size - 1, static_cast<int>(std::floor((high - min) / step - 0.5)));
    };
    const int row_end = last(std::max({a.y(), b.y(), c.y()}), grid.y_min, grid.step, grid.height);
    const int column_end = last(std::max({a.x(), b.x(), c.x()}), grid.x_min, grid.step, grid.width);
    for (int row = first(std::min({a.y(), b.y(), c.y()}), grid.y_min, grid.step); row <= row_end;
         ++row) {
      for (int column = first(std::min({a.x(), b.x(), c.x()}), grid.x_min, grid.step);
           column <= column_end; ++column) {
        const double x = grid.x_centre(column), y = grid.y_centre(row);
        const double v = ((x - a.x()) * (c.y() - a.y()) - (c.x() - a.x()) * (y - a.y())) / area;
        const double w = ((b.x() - a.x()) * (y - a.y()) - (x - a.x()) * (b.y() - a.y())) / area;
        if (v < 0 || w < 0 || v + w > 1) continue;
        const auto z = static_cast<float>(a.z() + v * (b.z() - a.z()) + w * (c.z() - a.z()));
        const std::size_t cell =
            static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.width) +
            static_cast<std::size_t>(column);
        if (heights.z[cell] >= z) continue;
        heights.z[cell] = z;
        hidden[cell] = is_hidden ? 1 : 0;
      }
    }
  }
  for (std::size_t cell = 0; cell < hidden.size(); ++cell) {
    if (hidden[cell] != 0) heights.z[cell] = std::numeric_limits<float>::quiet_NaN();
  }
  return heights;
}

HeightError ErrorOfHeights(const HeightMap& estimate, const HeightMap& truth) {
  std::vector<double> differences_m;
  std::size_t num_true = 0;
  for (std::size_t cell = 0; cell < truth.z.size(); ++cell) {
    if (!std::isfinite(truth.z[cell])) continue;
    ++num_true;
    if (std::isfinite(estimate.z[cell]))
      differences_m.push_back(static_cast<double>(estimate.z[cell]) - truth.z[cell]);
  }
  return SummariseHeights(std::move(differences_m), num_true);
}

namespace {

/// Distance of a point from a map's surface, normal to it; nothing where the map is empty.
std::optional<double> DistanceAcross(const HeightMap& map, const Eigen::Vector3d& p) {
  const GridShape& grid = map.grid;
  const auto cell = grid.cell(p.x(), p.y());
  if (!cell) return std::nullopt;
  const auto width = static_cast<std::size_t>(grid.width);
  if (*cell < width || *cell + width >= map.z.size()) return std::nullopt;
  const auto slope = [&](std::size_t step) {
    return (static_cast<double>(map.z[*cell + step]) - map.z[*cell - step]) / (2 * grid.step);
  };
  const double along_x = slope(1), along_y = slope(width);
  const int column = static_cast<int>(*cell % width), row = static_cast<int>(*cell / width);
  const double height = map.z[*cell] + along_x * (p.x() - grid.x_centre(column)) +
                        along_y * (p.y() - grid.y_centre(row));
  const double distance = (p.z() - height) / std::sqrt(1 + along_x * along_x + along_y * along_y);
  return std::isfinite(distance) ? std::optional(distance) : std::nullopt;
}

}  // namespace

DeformationError ErrorOfDeformation(const Deformation& deformation, const Pose& T_motion,
                                    const HeightMap& true_heights) {
  std::vector<double> rigid_mm, deformed_mm;
  for (std::size_t i = 0; i < deformation.points.size(); ++i) {
    if (deformation.observed[i] == 0) continue;
    const Eigen::Vector3d p = deformation.points[i].cast<double>();
    const Eigen::Vector3d shift = deformation.shifts_m[i].cast<double>();
    const auto rigid = DistanceAcross(true_heights, T_motion * p);
    const auto deformed = DistanceAcross(true_heights, T_motion * (p + shift));
    if (!rigid || !deformed) continue;
    rigid_mm.push_back(std::abs(*rigid) / kMillimetre);
    deformed_mm.push_back(std::abs(*deformed) / kMillimetre);
  }
  return {.rigid_mm = Summarise(std::move(rigid_mm)),
          .deformed_mm = Summarise(std::move(deformed_mm))};
}

std::optional<ShapeError> ErrorOfShape(const HeightMap& estimate, const HeightMap& truth) {
  using Row = Eigen::Matrix<double, 7, 1>;
  const GridShape& grid = truth.grid;
  constexpr int kStride = 2;          // every second cell determines seven numbers well enough
  constexpr double kScale_m = 0.003;  // of the robust weight: larger than noise, smaller than edges
  std::vector<Row> rows;
  std::vector<double> differences;
  std::vector<Eigen::Vector3d> points;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  const auto width = static_cast<std::size_t>(grid.width);
  for (int row = 1; row + 1 < grid.height; row += kStride) {
    for (int column = 1; column + 1 < grid.width; column += kStride) {
      const std::size_t cell =
          static_cast<std::size_t>(row) * width + static_cast<std::size_t>(column);
      const double hx =
          (static_cast<double>(truth.z[cell + 1]) - truth.z[cell - 1]) / (2 * grid.step);
      const double hy =
          (static_cast<double>(truth.z[cell + width]) - truth.z[cell - width]) / (2 * grid.step);
      const double difference = static_cast<double>(estimate.z[cell]) - truth.z[cell];
      // A vertical difference is not meaningful on a flank steeper than about 63 degrees.
      if (!std::isfinite(difference) || !std::isfinite(hx + hy) || std::hypot(hx, hy) > 2) continue;
      points.emplace_back(grid.x_centre(column), grid.y_centre(row), truth.z[cell]);
      centre += points.back();
      rows.emplace_back();
      rows.back() << -hx, -hy, 1, 0, 0, 0, 0;
      differences.push_back(difference);
    }
  }
  if (rows.size() < 100) return std::nullopt;
  centre /= static_cast<double>(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    // A surface point displaced by d raises the height at its place by g . d, g = (-hx, -hy, 1).
    const Eigen::Vector3d g = rows[i].head<3>();
    rows[i].segment<3>(3) = (points[i] - centre).cross(g);
    rows[i](6) = points[i].dot(g);
  }
  Row solution = Row::Zero();
  for (int iteration = 0; iteration < 8; ++iteration) {
    Eigen::Matrix<double, 7, 7> normal = Eigen::Matrix<double, 7, 7>::Zero();
    Row right = Row::Zero();
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const double ratio = (differences[i] - rows[i].dot(solution)) / kScale_m;
      const double weight = 1.0 / ((1.0 + ratio * ratio) * rows[i].head<3>().squaredNorm());
      normal += weight * rows[i] * rows[i].transpose();
      right += weight * differences[i] * rows[i];
    }
    solution = normal.ldlt().solve(right);
  }
  if (!solution.allFinite()) return std::nullopt;
  ShapeError error;
  error.shift_mm = solution.head<3>() / kMillimetre;
  error.rotation_deg = solution.segment<3>(3) / kDegree;
  error.scale_permille = solution(6) * 1000.0;
  std::vector<double> left;
  for (std::size_t i = 0; i < rows.size(); ++i)
    left.push_back(differences[i] - rows[i].dot(solution));
  error.left = SummariseHeights(std::move(left), rows.size());
  return error;
}

}  // namespace plumb
