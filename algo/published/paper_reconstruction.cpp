// SPDX-License-Identifier: Apache-2.0
#include "algo/published/paper_reconstruction.hpp"

#include <array>
#include <cmath>
#include <map>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "algo/geometry/back_projection.hpp"
#include "algo/geometry/rigid_fit.hpp"
#include "algo/markers/corner_depth.hpp"

namespace plumb {
namespace {

constexpr double kSingleViewSigma = 0.01;  // metres; error of the mean of a single window
constexpr double kMinSigma = 5e-4;
constexpr int kDepthWindow_px = 11;  // s, at 640 columns

/// Sums over the views of one corner.
struct CornerSums {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double sum_squared = 0.0;
  int count = 0;
};

std::vector<std::shared_ptr<const RayTable>> RaysOf(std::span<const Keyframe> keyframes) {
  RayTables tables;
  std::vector<std::shared_ptr<const RayTable>> rays;
  rays.reserve(keyframes.size());
  for (const Keyframe& keyframe : keyframes) rays.push_back(tables.For(keyframe.view.intrinsics));
  return rays;
}

SceneMarker MeanMarker(const std::array<CornerSums, 4>& sums) {
  SceneMarker marker;
  marker.num_views = sums[0].count;
  double scatter = 0.0;
  for (std::size_t k = 0; k < 4; ++k) {
    const double count = sums[k].count;
    marker.corners[k] = sums[k].sum / count;
    marker.num_views = std::min(marker.num_views, sums[k].count);
    if (sums[k].count > 1)
      scatter += (sums[k].sum_squared - count * marker.corners[k].squaredNorm()) /
                 (3.0 * (count - 1.0)) / 4.0;
  }
  marker.sigma_m = marker.num_views > 1
                       ? std::max(kMinSigma, std::sqrt(std::max(0.0, scatter) / marker.num_views))
                       : kSingleViewSigma;
  return marker;
}

}  // namespace

std::vector<PointCloud> KeyframeClouds(std::span<const Keyframe> keyframes) {
  const auto rays = RaysOf(keyframes);
  std::vector<PointCloud> clouds(keyframes.size());
  tbb::parallel_for(std::size_t{0}, keyframes.size(), [&](std::size_t j) {
    DepthView view = keyframes[j].view;
    view.color_rgb = cv::Mat();
    clouds[j] = BackProject(view, *rays[j]);
    if (clouds[j].empty())
      throw std::invalid_argument(
          fmt::format("keyframe clouds: keyframe {} has no valid depth", j));
    const Eigen::Matrix3f R = view.T_world_camera.linear().cast<float>();
    const Eigen::Vector3f t = view.T_world_camera.translation().cast<float>();
    for (Eigen::Vector3f& p : clouds[j].points) p = (R * p + t).eval();
  });
  return clouds;
}

MarkerMap AverageMarkers(std::span<const Keyframe> keyframes,
                         std::span<const Pose> T_refined_world) {
  if (keyframes.size() != T_refined_world.size())
    throw std::invalid_argument(fmt::format("marker map: {} poses for {} keyframes",
                                            T_refined_world.size(), keyframes.size()));
  const auto rays = RaysOf(keyframes);
  std::map<int, std::array<CornerSums, 4>> sums;
  for (std::size_t j = 0; j < keyframes.size(); ++j) {
    const Pose T_refined_camera = T_refined_world[j] * keyframes[j].view.T_world_camera;
    for (const MarkerObservation& seen : keyframes[j].markers) {
      const auto positions =
          PaperCornerPositions(seen, keyframes[j].view, *rays[j], kDepthWindow_px);
      for (std::size_t k = 0; k < 4; ++k) {
        if (!positions[k]) continue;
        const Eigen::Vector3d p = T_refined_camera * *positions[k];
        CornerSums& corner = sums[seen.id][k];
        corner.sum += p;
        corner.sum_squared += p.squaredNorm();
        ++corner.count;
      }
    }
  }
  MarkerMap markers;
  for (const auto& [id, corners] : sums) {
    const bool complete = corners[0].count > 0 && corners[1].count > 0 && corners[2].count > 0 &&
                          corners[3].count > 0;
    if (complete) markers.emplace(id, MeanMarker(corners));
  }
  return markers;
}

std::optional<Pose> ReferenceFrame(const MarkerMap& markers_in_world, int id,
                                   double marker_length_m) {
  const auto found = markers_in_world.find(id);
  if (found == markers_in_world.end()) return std::nullopt;
  const RigidFit fit = FitRigid(CornersInMarkerFrame(marker_length_m), found->second.corners);
  if (!fit.valid) return std::nullopt;
  return fit.T_a_b;
}

HeightMap HeightMapOfKeyframes(std::span<const PointCloud> clouds_in_world,
                               std::span<const Pose> T_refined_world, const Pose& T_marker_world,
                               const HeightMapOptions& options) {
  std::vector<Pose> T_marker_cloud;
  T_marker_cloud.reserve(T_refined_world.size());
  for (const Pose& T : T_refined_world) T_marker_cloud.push_back(T_marker_world * T);
  return PaperHeightMap(clouds_in_world, T_marker_cloud, options);
}

PaperReconstruction ReconstructAsPublished(
    std::span<const Keyframe> keyframes, const PaperOptions& options, const std::stop_token& stop,
    const std::function<void(std::string_view stage)>& on_stage,
    const std::function<void(double fraction)>& progress) {
  const auto enter = [&](std::string_view stage) {
    CheckStop(stop);
    if (on_stage) on_stage(stage);
  };
  PaperReconstruction result;
  enter("clouds");
  const std::vector<PointCloud> clouds_in_world = KeyframeClouds(keyframes);
  enter("global_registration");
  GlobalIcpResult icp = RefinePoses(clouds_in_world, options.icp, stop, progress);
  result.T_refined_world = std::move(icp.T_refined_world);
  result.icp_rms_m = std::move(icp.rms_per_iteration);
  enter("markers");
  result.markers_in_world = AverageMarkers(keyframes, result.T_refined_world);
  if (options.room_markers.reference)
    result.T_marker_world = ReferenceFrame(result.markers_in_world, *options.room_markers.reference,
                                           options.room_markers.length_m);
  if (result.T_marker_world) {
    enter("height_map");
    result.height_map = HeightMapOfKeyframes(clouds_in_world, result.T_refined_world,
                                             *result.T_marker_world, options.height_map);
  }
  enter("");
  return result;
}

}  // namespace plumb
