// SPDX-License-Identifier: Apache-2.0
#include "algo/bundle/witnesses.hpp"

#include <cmath>
#include <optional>
#include <vector>

#include <tbb/parallel_for.h>
#include <Eigen/Cholesky>

#include "algo/base/robust_weights.hpp"
#include "algo/base/statistics.hpp"
#include "algo/bundle/bundle_model.hpp"

namespace plumb {
namespace {

using namespace bundle;  // NOLINT: the residuals' own vocabulary

constexpr int kOneIn = 16;  // The same fraction of each kind as of the dense cells.
constexpr int kChosen = 7;  // Which of them; any would do.
constexpr int kPointIterations = 6;
constexpr double kLossScale_px = 1.0;

struct View {
  const CameraState* camera;
  Eigen::Vector2d pixel;
};

class Images {
 public:
  Images(const Intrinsics& stated, const CalibrationModel& calibration, const TrackingMap& map)
      : stated_(stated), calibration_(calibration) {
    for (const MapKeyframe& keyframe : map.keyframes) {
      CameraState& camera = cameras_.emplace_back();
      camera.T_camera0_world = keyframe.T_world_color.inverse();
      camera.velocity_per_s = keyframe.velocity_per_s;
      camera.Prepare();
    }
  }

  [[nodiscard]] const CameraState& camera(std::size_t keyframe) const { return cameras_[keyframe]; }
  // Offset of a point's projection from its observation, with the derivative with respect to the
  // point; nothing behind the camera.
  struct Residual {
    Eigen::Vector2d px;
    Eigen::Matrix<double, 2, 3> J_world;
  };
  [[nodiscard]] std::optional<Residual> At(const View& view, const Eigen::Vector3d& p_world) const {
    const double fraction = ReadoutFraction(view.pixel, stated_);
    const SeenPoint seen = See(*view.camera, p_world, calibration_.readout_s[0] * fraction);
    if (seen.p.z() < kNearestPoint_m) return std::nullopt;
    const SeenPixel projected = ProjectCorrected(stated_, calibration_.lens, seen.p);
    return Residual{projected.pixel - view.pixel, projected.J_point * seen.J_world};
  }

 private:
  const Intrinsics& stated_;
  const CalibrationModel& calibration_;
  std::vector<CameraState> cameras_;
};

// Distances between a landmark's observations and its projections, after it has been triangulated
// from these observations; empty if it cannot be.
std::vector<double> DistancesOf(const Images& images, const std::vector<View>& views,
                                Eigen::Vector3d p_world, double px) {
  for (int i = 0; i < kPointIterations; ++i) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (const View& view : views) {
      const auto residual = images.At(view, p_world);
      if (!residual) return {};
      const double w = CauchyWeight(residual->px.squaredNorm(), kLossScale_px * px);
      H.noalias() += w * residual->J_world.transpose() * residual->J_world;
      g.noalias() += w * residual->J_world.transpose() * residual->px;
    }
    const Eigen::Vector3d step = H.ldlt().solve(g);
    if (!step.allFinite()) return {};
    p_world -= step;
  }
  std::vector<double> distances;
  for (const View& view : views) {
    const auto residual = images.At(view, p_world);
    if (!residual) return {};
    distances.push_back(residual->px.norm() / px);
  }
  return distances;
}

std::vector<double> KeypointDistances(const Images& images, const TrackingMap& map, double px) {
  std::vector<std::vector<View>> views(map.landmarks.size());
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    for (const KeypointObservation& o : map.keyframes[k].keypoints) {
      const auto id = static_cast<std::size_t>(o.landmark);
      if (IsWitness(map.landmarks[id], o.landmark))
        views[id].push_back({&images.camera(k), o.pixel});
    }
  std::vector<std::vector<double>> parts(views.size());
  tbb::parallel_for(std::size_t{0}, views.size(), [&](std::size_t id) {
    if (static_cast<int>(views[id].size()) >= kMinWitnessViews)
      parts[id] = DistancesOf(images, views[id], map.landmarks[id].p_world, px);
  });
  std::vector<double> all;
  for (const std::vector<double>& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

std::vector<double> CornerDistances(const Images& images, const CalibrationModel& calibration,
                                    double marker_length_m, const TrackingMap& map, double px) {
  const MarkerCorners in_marker = CornersInMarkerFrame(marker_length_m);
  std::vector<double> all;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
    for (const MarkerObservation& m : map.keyframes[k].data.markers) {
      const auto found = map.markers.find(m.id);
      if (found == map.markers.end() || !IsWitness(found->second, m.id, static_cast<int>(k)))
        continue;
      for (std::size_t i = 0; i < 4; ++i) {
        const auto residual = images.At({&images.camera(k), m.corners[i]},
                                        found->second.T_world_marker * in_marker[i]);
        if (!residual) continue;
        const Eigen::Vector2d inward = Inward(m.corners, i);
        all.push_back((residual->px + calibration.edge_bias_px[0] * px * inward).norm() / px);
      }
    }
  }
  return all;
}

// True if the error grew by more than the scatter of two medians of that many values explains (four
// standard deviations; the median of a distance in two dimensions scatters by its own size over the
// square root of the number) and by more than a tenth; less does not indicate a bent path.
bool IsWorse(double before_px, double after_px, int count) {
  constexpr double kTolerated = 1.1;
  constexpr double kSigmas = 4.0;
  constexpr int kEnough = 40;
  if (count < kEnough) return false;
  return after_px > before_px * (kTolerated + kSigmas / std::sqrt(static_cast<double>(count)));
}

}  // namespace

bool IsWitness(const Landmark& landmark, int id) {
  return id % kOneIn == kChosen && landmark.usable && landmark.num_observations >= kMinWitnessViews;
}

bool IsWitness(const MapMarker& marker, int id, int keyframe) {
  constexpr int kManyViews = 8;
  return (keyframe + id) % kOneIn == kChosen && marker.num_views >= kManyViews;
}

WitnessErrors ErrorsOfWitnesses(const Intrinsics& stated, const CalibrationModel& calibration,
                                double marker_length_m, const TrackingMap& map) {
  const Images images(stated, calibration, map);
  const double px = stated.width / 640.0;
  std::vector<double> keypoints = KeypointDistances(images, map, px);
  std::vector<double> corners = CornerDistances(images, calibration, marker_length_m, map, px);
  WitnessErrors errors;
  errors.num_keypoints = static_cast<int>(keypoints.size());
  errors.num_corners = static_cast<int>(corners.size());
  if (!keypoints.empty()) errors.keypoints_px = TakeMedian(keypoints);
  if (!corners.empty()) errors.corners_px = TakeMedian(corners);
  return errors;
}

bool ContradictsWitnesses(const WitnessErrors& before, const WitnessErrors& after) {
  return IsWorse(before.keypoints_px, after.keypoints_px, after.num_keypoints) ||
         IsWorse(before.corners_px, after.corners_px, after.num_corners);
}

}  // namespace plumb
