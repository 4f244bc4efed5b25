#include "algo/reconstruction/sensor_sensitivity.hpp"

#include <array>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>

#include <Eigen/Cholesky>

namespace plumb {
namespace {

constexpr double kPatch_m = 0.2;
constexpr int kCellStride = 4;      // Neighbouring cells move alike.
constexpr float kMinCells = 50.0F;  // A patch of fewer is a rim.
constexpr std::size_t kMaxPatches = 200;

using Columns = Eigen::Matrix<double, 3, kCalibrationSize>;

// Rows of the posterior's covariance with the calibration, for a twist; zero for what stayed.
using TwistColumns = Eigen::Matrix<double, 6, kCalibrationSize>;

TwistColumns RowsOf(const BundlePosterior& posterior, Eigen::Index first) {
  if (first < 0) return TwistColumns::Zero();
  return posterior.with_calibration.middleRows<6>(first);
}

// Covariance of a point with the calibration in the reference marker's frame, which moves itself.
struct MarkerFrame {
  Pose T_marker_world;
  TwistColumns twist;

  [[nodiscard]] Columns Seen(const Eigen::Vector3d& p_world, const Columns& in_world) const {
    const Eigen::Vector3d p = T_marker_world * p_world;
    return T_marker_world.linear() * in_world + Skew(p) * twist.topRows<3>() -
           twist.bottomRows<3>();
  }
};

Columns Moved(const Eigen::Matrix3d& R, const Eigen::Vector3d& p, const TwistColumns& twist) {
  return R * (twist.bottomRows<3>() - Skew(p) * twist.topRows<3>());
}

struct Sum {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Columns covariance = Columns::Zero();
  double count = 0;
};

using Key = std::tuple<int, int, int>;

Key CubeOf(const Eigen::Vector3d& p) {
  return {static_cast<int>(std::floor(p.x() / kPatch_m)),
          static_cast<int>(std::floor(p.y() / kPatch_m)),
          static_cast<int>(std::floor(p.z() / kPatch_m))};
}

std::map<Key, Sum> SumPatches(const Intrinsics& stated, const CalibrationModel& calibration,
                              const BundlePosterior& posterior, const TrackingMap& map,
                              const MarkerFrame& frame) {
  const dense::Cells cells = dense::MakeCells(stated, map);
  const dense::Sensor sensor = dense::MakeSensor(stated, calibration);
  const std::vector<dense::View> views = dense::MakeViews(sensor, calibration, cells, map);
  std::map<Key, Sum> sums;
  for (std::size_t k = 0; k < views.size(); ++k) {
    const dense::View& view = views[k];
    const TwistColumns twist = RowsOf(posterior, posterior.CameraAt(static_cast<int>(k)));
    const Eigen::Matrix3d R_world_color = map.keyframes[k].T_world_color.linear();
    for (int r = kCellStride / 2; r < view.height; r += kCellStride) {
      for (int c = kCellStride / 2; c < view.width; c += kCellStride) {
        const auto i = static_cast<std::size_t>(r * view.width + c);
        if (!(view.points[i].z() > 0)) continue;
        const Eigen::Vector3d p_depth = view.points[i].cast<double>();
        const Eigen::Vector3d p_world = view.T_world_depth * p_depth;
        const Columns in_world =
            Moved(R_world_color, view.T_color_depth * p_depth, twist) +
            view.T_world_depth.linear() *
                (dense::CellJacobian(sensor, view, i) * posterior.calibration());
        const Eigen::Vector3d p = frame.T_marker_world * p_world;
        Sum& sum = sums[CubeOf(p)];
        sum.centre += p;
        sum.covariance += frame.Seen(p_world, in_world);
        sum.count += 1;
      }
    }
  }
  return sums;
}

}  // namespace

SensorSensitivity SensitivityOf(const Intrinsics& stated, const CalibrationModel& calibration,
                                const BundlePosterior& posterior, const TrackingMap& map,
                                int reference_marker) {
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
    const Eigen::Index first = posterior.MarkerAt(id);
    if (first < 0) continue;
    const Columns in_world =
        Moved(marker.T_world_marker.linear(), Eigen::Vector3d::Zero(), RowsOf(posterior, first));
    result.markers[id] = derivative(frame.Seen(marker.T_world_marker.translation(), in_world));
  }
  for (const auto& [key, sum] : SumPatches(stated, calibration, posterior, map, frame)) {
    if (sum.count < kMinCells || result.surface.size() >= kMaxPatches) continue;
    result.surface.push_back({(sum.centre / sum.count).cast<float>(), static_cast<float>(sum.count),
                              derivative(sum.covariance / sum.count)});
  }
  return result;
}

}  // namespace plumb
