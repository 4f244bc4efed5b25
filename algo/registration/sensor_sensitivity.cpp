// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/sensor_sensitivity.hpp"

#include <cmath>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include <tbb/parallel_for.h>
#include <Eigen/Cholesky>

namespace plumb {
namespace {

constexpr double kCube_m = 0.2;
constexpr int kCellStride = 4;      // Neighbouring cells move alike.
constexpr float kMinCells = 50.0F;  // Patches with fewer cells are rims.
constexpr std::size_t kMaxPatches = 200;

using Columns = Eigen::Matrix<double, 3, kCalibrationSize>;

// Rows of the posterior's covariance with the calibration, for a twist; zero for a pose
// that was fixed.
using TwistColumns = Eigen::Matrix<double, 6, kCalibrationSize>;

TwistColumns RowsOf(const BundlePosterior& posterior, std::optional<Eigen::Index> first) {
  if (!first) return TwistColumns::Zero();
  return posterior.with_calibration.middleRows<6>(*first);
}

// Covariance of a point with the calibration in the reference marker's frame, which moves itself.
struct MarkerFrame {
  Pose T_marker_world;
  TwistColumns twist;

  // Covariance of the sum of `count` points; `sum` is their sum in the marker's frame.
  [[nodiscard]] Columns Seen(const Eigen::Vector3d& sum, double count,
                             const Columns& in_world) const {
    return T_marker_world.linear() * in_world + Skew(sum) * twist.topRows<3>() -
           count * twist.bottomRows<3>();
  }
};

// Covariance of the sum of `count` points in a frame that moves by the twist; `sum` is their sum.
Columns Moved(const Eigen::Matrix3d& R, const Eigen::Vector3d& sum, double count,
              const TwistColumns& twist) {
  return R * (count * twist.bottomRows<3>() - Skew(sum) * twist.topRows<3>());
}

using CubeKey = std::tuple<int, int, int>;

CubeKey CubeOf(const Eigen::Vector3d& p) {
  return {static_cast<int>(std::floor(p.x() / kCube_m)),
          static_cast<int>(std::floor(p.y() / kCube_m)),
          static_cast<int>(std::floor(p.z() / kCube_m))};
}

// What one view shows of a cube. Covariances are linear in the points and in their Jacobians, so
// sums over the cells are multiplied by the posterior once instead of every cell.
struct ViewSum {
  Eigen::Vector3d in_marker = Eigen::Vector3d::Zero();
  Eigen::Vector3d in_color = Eigen::Vector3d::Zero();
  // In the depth camera's frame, as what follows.
  Columns J_depth = Columns::Zero();
  Eigen::Matrix3d J_image = Eigen::Matrix3d::Zero();  // Of the image's own error.
  Eigen::Matrix<double, 3, dense::DepthCurve::kSize> J_curve =
      Eigen::Matrix<double, 3, dense::DepthCurve::kSize>::Zero();
  double count = 0;

  // @param along  Movement of the cell's point with its depth.
  void AddErrors(const Eigen::Vector3d& along, const dense::View& view, std::size_t cell) {
    const double z_m = view.keyframe->dense.z_m[cell];
    J_image += along * dense::ImageErrorJacobian(z_m, view.cells->centred[cell]).transpose();
    const dense::DepthCurve::Place place = dense::DepthCurve::At(z_m);
    J_curve.col(place.knot) += (1.0 - place.share) * along;
    J_curve.col(place.knot + 1) += place.share * along;
  }
  // Covariance of the sum of the points with the calibration where the camera stands, in the depth
  // camera's frame.
  [[nodiscard]] Columns Seen(const BundlePosterior& posterior,
                             const dense::DepthErrorColumns& errors, std::size_t image) const {
    Columns columns = J_depth * posterior.calibration();
    if (errors.empty()) return columns;
    columns += J_image * errors.OfImage(image);
    if (errors.has_curve()) columns += J_curve * errors.OfCurve();
    return columns;
  }
};

std::map<CubeKey, ViewSum> SumCells(const dense::Sensor& sensor, const dense::View& view,
                                    const Pose& T_marker_world) {
  std::map<CubeKey, ViewSum> sums;
  const Pose T_marker_depth = T_marker_world * view.T_world_depth;
  for (int r = kCellStride / 2; r < view.height; r += kCellStride) {
    for (int c = kCellStride / 2; c < view.width; c += kCellStride) {
      const auto i = static_cast<std::size_t>(r * view.width + c);
      if (!(view.points[i].z() > 0)) continue;
      const Eigen::Vector3d p_depth = view.points[i].cast<double>();
      const Eigen::Vector3d p = T_marker_depth * p_depth;
      ViewSum& sum = sums[CubeOf(p)];
      sum.in_marker += p;
      sum.in_color += view.T_color_depth * p_depth;
      sum.J_depth += dense::CellJacobian(sensor, view, i);
      sum.AddErrors(p_depth / p_depth.z(), view, i);
      sum.count += 1;
    }
  }
  return sums;
}

struct Sum {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Columns covariance = Columns::Zero();
  double count = 0;
};

std::map<CubeKey, Sum> SumPatches(const Intrinsics& stated, const CalibrationModel& calibration,
                                  const BundlePosterior& posterior,
                                  const dense::DepthErrorColumns& depth_errors,
                                  const TrackingMap& map, const MarkerFrame& frame) {
  const dense::Cells cells = dense::MakeCells(stated, map);
  const dense::Sensor sensor = dense::MakeSensor(stated, calibration);
  const std::vector<dense::View> views = dense::MakeViews(sensor, calibration, cells, map);
  std::vector<std::map<CubeKey, ViewSum>> seen(views.size());
  tbb::parallel_for(std::size_t{0}, views.size(), [&](std::size_t k) {
    seen[k] = SumCells(sensor, views[k], frame.T_marker_world);
  });
  std::map<CubeKey, Sum> sums;
  for (std::size_t k = 0; k < views.size(); ++k) {
    const TwistColumns twist = RowsOf(posterior, posterior.CameraAt(static_cast<int>(k)));
    const Eigen::Matrix3d R_world_color = map.keyframes[k].T_world_color.linear();
    for (const auto& [key, view_sum] : seen[k]) {
      const Columns in_world =
          Moved(R_world_color, view_sum.in_color, view_sum.count, twist) +
          views[k].T_world_depth.linear() * view_sum.Seen(posterior, depth_errors, k);
      Sum& sum = sums[key];
      sum.centre += view_sum.in_marker;
      sum.covariance += frame.Seen(view_sum.in_marker, view_sum.count, in_world);
      sum.count += view_sum.count;
    }
  }
  return sums;
}

}  // namespace

SensorSensitivity SensitivityOf(const Intrinsics& stated, const CalibrationModel& calibration,
                                const BundlePosterior& posterior,
                                const dense::DepthErrorColumns& depth_errors,
                                const TrackingMap& map, int reference_marker) {
  SensorSensitivity result;
  result.stated = stated;
  result.estimate = ToVector(calibration);
  result.covariance = posterior.calibration();
  // Terms that were not free have neither variance nor effect.
  CalibrationMatrix free = posterior.calibration();
  for (Eigen::Index i = 0; i < kCalibrationSize; ++i)
    if (!(free(i, i) > 0)) free(i, i) = 1.0;
  const Eigen::LDLT<CalibrationMatrix> solver(free);
  const auto derivative = [&](const Columns& covariance) -> SensorSensitivity::Derivative {
    return solver.solve(covariance.transpose()).transpose().cast<float>();
  };
  const MapMarker& reference = map.markers.at(reference_marker);
  const MarkerFrame frame{reference.T_world_marker.inverse(),
                          RowsOf(posterior, posterior.MarkerAt(reference_marker))};
  for (const auto& [id, marker] : map.markers) {
    const std::optional<Eigen::Index> first = posterior.MarkerAt(id);
    if (!first) continue;
    const Columns in_world =
        Moved(marker.T_world_marker.linear(), Eigen::Vector3d::Zero(), 1, RowsOf(posterior, first));
    result.markers[id] = derivative(
        frame.Seen(frame.T_marker_world * marker.T_world_marker.translation(), 1, in_world));
  }
  for (const auto& [key, sum] :
       SumPatches(stated, calibration, posterior, depth_errors, map, frame)) {
    if (sum.count < kMinCells || result.surface.size() >= kMaxPatches) continue;
    result.surface.push_back({(sum.centre / sum.count).cast<float>(), static_cast<float>(sum.count),
                              derivative(sum.covariance / sum.count)});
  }
  return result;
}

}  // namespace plumb
